"""Load shedding: while too many strangers connect, a share of their attempts is dropped."""

import math
import time
from collections.abc import Callable
from typing import Final

from common.token_bucket import TokenBucket

BURST: Final = 128
"""Connections of strangers that are all accepted: as many as may be pending (admission.py)."""
PER_S: Final = 64.0
"""And so many a second: their TLS handshakes take less than a tenth of a core."""
RAISE_FACTOR: Final = 8
"""At a look at the connections that finds more."""
RAISE_AFTER_S: Final = 0.09
"""Since it was raised last: what has come meanwhile may have been on its way before that."""
LOWER_FACTOR: Final = 2
LOWER_AFTER_S: Final = 1.0
"""Without an excess: TCP tries again one second after its first attempt (RFC 6298 2.1)."""
MAX_ONE_IN: Final = 512


class Shedding:
    """Raises the share that is dropped fast and lowers it slowly. Pure; used on one event loop.

    Args:
        clock: seconds, monotonic.

    Attributes:
        one_in: of how many attempts one is to be let through; a power of two.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._bucket = TokenBucket(BURST, clock())
        self._exceeded = False
        self._changed_s = -math.inf
        self.one_in = 1

    @property
    def active(self) -> bool:
        """Whether attempts are dropped."""
        return self.one_in > 1

    def note_stranger(self) -> None:
        """Takes down a new connection of an address that is not trusted."""
        if not self._bucket.take(self._clock(), capacity=BURST, refill_per_s=PER_S):
            self._exceeded = True

    def adapt(self) -> None:
        """Raises the share that is dropped if there were too many since the last time; else lowers it."""
        now_s = self._clock()
        if self._exceeded:
            if now_s - self._changed_s < RAISE_AFTER_S:
                return
            self._exceeded = False
            self.one_in = min(MAX_ONE_IN, self.one_in * RAISE_FACTOR)
            self._changed_s = now_s
        elif self.active and now_s - self._changed_s >= LOWER_AFTER_S:
            self.one_in //= LOWER_FACTOR
            self._changed_s = now_s
