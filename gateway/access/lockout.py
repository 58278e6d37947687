"""Lockout of callers who repeatedly present wrong credentials, with exponentially growing waits.

The unit that is locked is a pair of address and credential. A guesser of Anna's token locks the use of that
token from their own address; Ben behind the same address (a tunnel, a Wi-Fi router) is not affected, nor is
Anna at any address: her own token is right, and what is right is never locked. Guesses that name no
credential of this robot share one entry per address.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from common.backoff import Backoff
from common.errors import TooMuchError
from common.reasons import Reason

FREE_FAILURES: Final = 5
"""Failures without a wait: people mistype, and programs start with an old token."""
FIRST_WAIT_S: Final = 1.0
LONGEST_WAIT_S: Final = 60.0
FORGET_AFTER_S: Final = 600.0
"""Seconds without a failure after which earlier ones no longer count."""
MAX_ENTRIES: Final = 1024
"""Beyond that, the entry whose last failure is oldest is dropped. An attacker with a thousand addresses
evades the lockout, but still has to guess 256 bits."""


@dataclass(slots=True)
class _Entry:
    last_s: float
    locked_until_s: float
    failures: int = 0
    wait: Backoff = field(default_factory=lambda: Backoff(FIRST_WAIT_S, LONGEST_WAIT_S))


class Lockout:
    """Failure counts by address prefix and credential. Used on one event loop alone.

    Args:
        clock: monotonic seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._entries: dict[tuple[str, str], _Entry] = {}
        """Ordered by last failure, the latest at the end."""

    def check(self, address_prefix: str, credential_id: str) -> None:
        """Checks whether the pair is locked, after a wrong token.

        Args:
            address_prefix: of the caller, see gateway/access/address_prefix.py.
            credential_id: the credential that the token names; empty if this robot has none of that id.

        Raises:
            TooMuchError: the pair is locked.
        """
        entry = self._entries.get((address_prefix, credential_id))
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

    def failed(self, address_prefix: str, credential_id: str) -> bool:
        """Counts a failed attempt; returns whether the pair is locked now."""
        key, now_s = (address_prefix, credential_id), self._clock()
        entry = self._entries.pop(key, None)
        if entry is None or now_s - entry.last_s > FORGET_AFTER_S:
            entry = _Entry(now_s, now_s)
        entry.failures += 1
        entry.last_s = now_s
        locked = entry.failures > FREE_FAILURES
        if locked:
            entry.locked_until_s = now_s + entry.wait.next_s()
        self._entries[key] = entry
        if len(self._entries) > MAX_ENTRIES:
            del self._entries[next(iter(self._entries))]
        return locked

    def succeeded(self, address_prefix: str, credential_id: str) -> None:
        """Resets the pair after a right token, unless it is locked: a guesser may have the same address."""
        # Every call passes here, and nearly always there are no entries.
        entry = self._entries.get((address_prefix, credential_id)) if self._entries else None
        if entry is not None and entry.locked_until_s <= self._clock():
            del self._entries[address_prefix, credential_id]
