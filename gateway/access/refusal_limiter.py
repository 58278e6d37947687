"""Rate limit of refusal reports, so that repeated refused calls do not fill the audit log. Pure.

Each caller has a token bucket: a burst is reported call by call, then one refusal a minute, together with the
number of those that were suppressed before it.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from common.token_bucket import TokenBucket

BURST: Final = 10
"""Capacity of a bucket, in tokens; each report takes one."""
REFILL_S: Final = 60.0
"""Seconds in which a bucket gains one token."""
MAX_CALLERS: Final = 256
"""Buckets kept; beyond that, the least recently used one is dropped."""


@dataclass(slots=True)
class _Caller:
    bucket: TokenBucket
    suppressed: int = 0


class RefusalLimiter:
    """One token bucket per caller. Used on one event loop alone.

    Args:
        clock: monotonic seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._callers: dict[str, _Caller] = {}
        """Ordered by last use, the latest at the end."""

    def take(self, caller: str) -> int | None:
        """Takes a token for one refusal of this caller, a name or an address.

        Returns:
            The number of refusals suppressed since the last reported one, or None if this one is to be
            suppressed, too.
        """
        now_s = self._clock()
        known = self._callers.pop(caller, None) or _Caller(TokenBucket(BURST, now_s))
        self._callers[caller] = known
        if len(self._callers) > MAX_CALLERS:
            del self._callers[next(iter(self._callers))]
        if not known.bucket.take(now_s, capacity=BURST, refill_per_s=1 / REFILL_S):
            known.suppressed += 1
            return None
        suppressed, known.suppressed = known.suppressed, 0
        return suppressed
