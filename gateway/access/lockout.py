"""Those who show wrong credentials again and again wait longer and longer.

What is locked is a pair: an address, and the credential that was meant. Somebody who guesses Anna's token
locks that token's use from their own address. Ben behind the same address (the same tunnel, the same Wi-Fi
router) goes on working, and so does Anna anywhere else. Guesses that name no credential of this robot share
one entry per address, which locks nobody who has a credential.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, TypeAlias

from common.errors import TooMuchError
from common.reasons import Reason
from gateway.access.site import site_of

FREE: Final = 5
"""Wrong credentials that cost nothing: people mistype, and programs start with an old token."""
FIRST_WAIT_S: Final = 1.0
LONGEST_WAIT_S: Final = 60.0
FORGOTTEN_AFTER_S: Final = 600.0
"""Without a further failure."""
MOST: Final = 1024
"""Entries; of more than that, the one that failed longest ago is forgotten. Who has a thousand addresses is
not held up by this, and still has to guess 256 bits."""

Key: TypeAlias = tuple[str, str]


@dataclass(slots=True)
class _Entry:
    failures: int
    last_s: float
    locked_until_s: float


class Lockout:
    """Belongs to one event loop.

    Args:
        clock: seconds, monotonic.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._entries: dict[Key, _Entry] = {}
        """The one that failed last at the end."""

    def __len__(self) -> int:
        return len(self._entries)

    def admit(self, host: str, credential_id: str) -> None:
        """Lets an attempt through, or not.

        Args:
            host: where it comes from, without the port.
            credential_id: the one it means; empty when this robot has none such.

        Raises:
            TooMuchError: too many failed before.
        """
        # Every call comes by here, and nearly always nobody is locked out.
        entry = self._entries.get((site_of(host), credential_id)) if self._entries else None
        if entry is None:
            return
        left_s = entry.locked_until_s - self._clock()
        if left_s > 0:
            raise TooMuchError(
                f"{entry.failures} wrong credentials came from this address. "
                f"Try again in {math.ceil(left_s)} s",
                Reason.LOCKED_OUT,
                left_s,
            )

    def failed(self, host: str, credential_id: str) -> bool:
        """An attempt was wrong. Whether that has locked the pair just now."""
        key, now_s = (site_of(host), credential_id), self._clock()
        entry = self._entries.pop(key, None)
        if entry is None or now_s - entry.last_s > FORGOTTEN_AFTER_S:
            entry = _Entry(0, now_s, now_s)
        entry.failures += 1
        entry.last_s = now_s
        beyond = entry.failures - FREE
        if beyond > 0:
            entry.locked_until_s = now_s + min(LONGEST_WAIT_S, FIRST_WAIT_S * 2.0 ** min(beyond - 1, 16))
        self._entries[key] = entry
        if len(self._entries) > MOST:
            del self._entries[next(iter(self._entries))]
        return beyond > 0

    def succeeded(self, host: str, credential_id: str) -> None:
        """An attempt was right: what failed before it is forgotten."""
        if self._entries:
            self._entries.pop((site_of(host), credential_id), None)
