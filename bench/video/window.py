"""What a viewer saw of the frames that the camera took in a window of time. Pure."""

import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Self


@dataclass(frozen=True, slots=True)
class Glance:
    """One decoded frame; times on `time.monotonic()`.

    Args:
        captured_s: when the camera took it.
        decoded_s: when the decoder delivered it.
        corrupt: whether the decoder concealed parts of it.
        error_ms: how much the age that the viewer itself gives is off; None without one.
    """

    captured_s: float
    decoded_s: float
    corrupt: bool = False
    error_ms: float | None = None

    @property
    def latency_ms(self) -> float:
        """From capture to decoded."""
        return (self.decoded_s - self.captured_s) * 1000


@dataclass(frozen=True, slots=True)
class Window:
    """Whole frames captured in a window, each once, by their capture time.

    Args:
        from_s: its beginning.
        until_s: its end.
        glances: the frames.
    """

    from_s: float
    until_s: float
    glances: tuple[Glance, ...]

    @classmethod
    def of(cls, seen: Iterable[Glance], from_s: float, until_s: float) -> Self:
        """Returns the window of everything that a viewer saw; a repeated frame counts once."""
        kept: dict[float, Glance] = {}
        for one in sorted(seen, key=lambda glance: glance.decoded_s):
            if not one.corrupt and from_s <= one.captured_s < until_s:
                kept.setdefault(one.captured_s, one)
        return cls(from_s, until_s, tuple(kept[captured_s] for captured_s in sorted(kept)))

    def delivered_percent(self, captured: int) -> float:
        """Returns the share of the camera's frames that were decoded whole.

        Args:
            captured: how many frames the camera took in the window.
        """
        return 100 * len(self.glances) / captured

    @property
    def frames_per_s(self) -> float:
        """Whole frames per second."""
        return len(self.glances) / (self.until_s - self.from_s)

    @property
    def median_ms(self) -> float:
        """Capture to decoded, median."""
        return statistics.median(one.latency_ms for one in self.glances)

    @property
    def p95_ms(self) -> float:
        """Capture to decoded, 95th percentile."""
        return statistics.quantiles((one.latency_ms for one in self.glances), n=20)[18]

    @property
    def p99_ms(self) -> float:
        """Capture to decoded, 99th percentile."""
        return statistics.quantiles((one.latency_ms for one in self.glances), n=100)[98]


def longest_gap_ms(glances: Iterable[Glance], from_s: float, until_s: float) -> float:
    """Returns the longest time without a newly decoded whole frame, in ms.

    Args:
        glances: everything that a viewer saw.
        from_s: counts as a frame, as does `until_s`: a gap at the edges is no shorter than seen.
        until_s: end of the time that counts.
    """
    decoded_s = sorted(one.decoded_s for one in glances if not one.corrupt)
    within_s = [from_s, *(one for one in decoded_s if from_s <= one <= until_s), until_s]
    return max(later - earlier for earlier, later in pairwise(within_s)) * 1000


def slope(counts: Sequence[float], figures: Sequence[float]) -> float:
    """Returns the slope of the line of least squares: how much a figure grows with each unit of the count."""
    return statistics.linear_regression(counts, figures).slope
