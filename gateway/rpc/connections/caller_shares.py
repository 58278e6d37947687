"""What each caller may take of the gateway, however many connections it has."""

import time
from collections import Counter
from collections.abc import Callable
from typing import Final

from common.errors import TooMuchError
from common.reasons import Reason
from common.token_bucket import TokenBucket
from gateway.config import LimitSettings

_BURST_S: Final = 2.0
"""A bucket holds what is refilled in this time."""
MAX_OPEN_CALLS: Final = 512
"""Of one caller, besides its streams: an eighth of what the gateway serves at once (`Room`). Calls last
milliseconds: only a caller that withholds requests, over many connections, comes near it."""
_MAX_IDLE: Final = 256
"""Buckets of callers that have called before; where there are more, the full ones are forgotten."""
_RETRY_AFTER_S: Final = 1.0
"""Suggested to a caller with too many open calls."""


class CallerShares:
    """Requests, open calls and streams by caller: a name on credentials, else an address prefix. Pure.

    Args:
        limits: what a caller may have.
        clock: seconds, monotonic.
    """

    def __init__(self, limits: LimitSettings, clock: Callable[[], float] = time.monotonic) -> None:
        self._limits = limits
        self._clock = clock
        self._buckets: dict[str, TokenBucket] = {}
        self._calls: Counter[str] = Counter()
        """Open ones that are no streams."""
        self._streams: Counter[str] = Counter()

    def take_token(self, caller: str) -> None:
        """Takes one token out of the caller's bucket.

        Raises:
            TooMuchError: it is empty.
        """
        rate_per_s, now_s = self._limits.caller_requests_per_s, self._clock()
        bucket = self._buckets.get(caller)
        if bucket is None:
            if len(self._buckets) >= _MAX_IDLE:
                self._forget_full(now_s)
            bucket = self._buckets[caller] = TokenBucket(self._capacity, now_s)
        if not bucket.take(now_s, capacity=self._capacity, refill_per_s=rate_per_s):
            raise TooMuchError(
                f"the connections of {caller} make more than {rate_per_s:g} requests a second together; "
                "call less often",
                Reason.TOO_MANY_REQUESTS,
                (1 - bucket.tokens) / rate_per_s,
            )

    def open_call(self, caller: str) -> None:
        """Counts one more open call of the caller that is no stream.

        Raises:
            TooMuchError: it has as many as allowed.
        """
        if self._calls[caller] >= MAX_OPEN_CALLS:
            raise TooMuchError(
                f"{caller} has {self._calls[caller]} calls open, and no more are allowed; send each request "
                "with its call, and wait for answers",
                Reason.TOO_MANY_REQUESTS,
                _RETRY_AFTER_S,
            )
        self._calls[caller] += 1

    def close_call(self, caller: str) -> None:
        """Counts one call less, after `open_call`."""
        self._calls[caller] -= 1
        if not self._calls[caller]:
            del self._calls[caller]

    def open_stream(self, caller: str) -> None:
        """Counts one more stream of the caller.

        Raises:
            TooMuchError: it has as many as allowed.
        """
        if self._streams[caller] >= self._limits.caller_streams:
            raise TooMuchError(
                f"{caller} has {self._streams[caller]} streams open, and no more are allowed; close one, "
                "or share it",
                Reason.TOO_MANY_STREAMS,
            )
        self._streams[caller] += 1

    def close_stream(self, caller: str) -> None:
        """Counts one stream less, after `open_stream`."""
        self._streams[caller] -= 1
        if not self._streams[caller]:
            del self._streams[caller]

    @property
    def _capacity(self) -> float:
        return max(1.0, self._limits.caller_requests_per_s * _BURST_S)

    def _forget_full(self, now_s: float) -> None:
        """A bucket that is full may be forgotten: a new one holds no less."""
        self._buckets = {
            caller: bucket for caller, bucket in self._buckets.items() if now_s - bucket.updated_s < _BURST_S
        }
