"""How long data waits in a queue on its way, seen from outside: a delay above its own minimum. Pure.

A link that gets more than its capacity queues the rest, so every delay through it grows, by 1 - capacity/rate
seconds a second, before anything is lost. The delay of the empty link is not known; its minimum so far is the
best estimate. The minimum rises slowly, so that a robot that moved away gets a new one.
"""

from typing import Final

_DRIFT_PER_S: Final = 0.04
_RISE_MS: Final = 10.0
_FALL_MS: Final = 5.0
"""Smaller changes between two observations say nothing about a queue."""
_LEAP: Final = 2.0
"""Of the delay that counts as long."""
_BEGINNING_MS: Final = 20.0
"""A little more than the longest that HyStart++ takes (RFC 9406 4.3), because radio links jitter."""


class QueueDelay:
    """One delay, observed about twice a second.

    Args:
        slack_ms: above its minimum, a delay is never long within this.
        slack_share: nor within this share of the minimum.
    """

    def __init__(self, slack_ms: float, slack_share: float = 0.0) -> None:
        self._slack_ms = slack_ms
        self._slack_share = slack_share
        self._lowest_ms: float | None = None
        self._last: tuple[float, float] | None = None
        self._change_ms = 0.0
        self.delay_ms = 0.0
        """The newest observation."""
        self.growth = 0.0
        """Seconds a second, from 0 to 1: the share of the data that the link could not carry."""

    def observe(self, delay_ms: float, now: float) -> None:
        """Takes an observation, at monotonic seconds `now`."""
        if self._last is None or self._lowest_ms is None:
            self._lowest_ms = delay_ms
        else:
            before_ms, at = self._last
            elapsed_s = max(now - at, 1e-3)
            self._lowest_ms = min(delay_ms, self._lowest_ms * (1 + _DRIFT_PER_S * elapsed_s))
            self._change_ms = delay_ms - before_ms
            self.growth = min(1.0, max(0.0, self._change_ms / 1000 / elapsed_s))
        self._last = (delay_ms, now)
        self.delay_ms = delay_ms

    @property
    def queued_ms(self) -> float:
        """Time in the queue."""
        return self.delay_ms - (self._lowest_ms or 0.0)

    @property
    def is_long(self) -> bool:
        """Whether there is a queue."""
        return self.queued_ms > self._limit_ms

    def leaps_to(self, delay_ms: float) -> bool:
        """Whether a delay between two observations shows a queue that fills fast."""
        lowest_ms = self._lowest_ms
        falls = delay_ms < self.delay_ms - _FALL_MS
        return lowest_ms is not None and not falls and delay_ms - lowest_ms > _LEAP * self._limit_ms

    def begins_at(self, delay_ms: float) -> bool:
        """Whether a delay shows that a queue begins, where the rate has just been raised by much."""
        return self._lowest_ms is not None and delay_ms - self._lowest_ms > _BEGINNING_MS

    @property
    def is_draining(self) -> bool:
        """Whether it becomes shorter."""
        return self._change_ms < -_FALL_MS

    @property
    def is_calm(self) -> bool:
        """Whether there is no sign of a queue, not even of one that begins."""
        return self.queued_ms <= self._limit_ms / 2 and self._change_ms <= _RISE_MS

    @property
    def _limit_ms(self) -> float:
        return max(self._slack_ms, self._slack_share * (self._lowest_ms or 0.0))
