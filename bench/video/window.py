"""What a viewer saw of the frames that the camera took in a window of time. Pure."""

import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, Self

from bench.rows import MeasurementError

_HALVINGS: Final = 50
_OLDEST_S: Final = 1.0
"""How much less than the time watched the captures of a stream that goes on span."""


@dataclass(frozen=True, slots=True)
class Glance:
    """One decoded frame; times on `time.monotonic()`.

    Args:
        captured_s: when the camera took it.
        decoded_s: when the decoder delivered it.
        corrupt: whether it is torn, as far as the viewer knows, or the judge in far_viewing.py.
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


def delivered_of_due_percent(captured_ns: Iterable[int], fps: int, watched_s: float) -> float:
    """Returns how many of the frames that were due between the first and the last capture came, in percent.

    By capture times, each once: the rate at which frames come would say 100 % and more where the first one
    was late, or where some came twice.

    Args:
        captured_ns: when each whole frame that came was captured.
        fps: of the source, which misses none.
        watched_s: how long frames were waited for from the first one on.

    Raises:
        MeasurementError: of almost nothing there is no share, nor of a stream that ended meanwhile.
    """
    each_ns = sorted(set(captured_ns))
    span_s = (each_ns[-1] - each_ns[0]) / 1e9 if each_ns else 0.0
    if span_s < watched_s - _OLDEST_S:
        raise MeasurementError(f"frames of {span_s:.1f} s came in {watched_s:g} s: nothing was measured")
    due = round((each_ns[-1] - each_ns[0]) * fps / 1e9) if each_ns else 0
    if due == 0:
        raise MeasurementError(f"{len(each_ns)} frames: nothing was measured")
    return 100 * (len(each_ns) - 1) / due


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


class Glass:
    """Age of the picture that a viewer looks at, from the first one on, at every moment.

    It is that of the newest whole frame, and grows until another one is decoded: a viewer that shows nothing
    new shows an old picture. One that never shows any counts as if it had an old one from the beginning.

    Args:
        glances: everything that a viewer saw.
        from_s: begin of the time that counts, unless the first frame comes later.
        until_s: its end.
    """

    def __init__(self, glances: Iterable[Glance], from_s: float, until_s: float) -> None:
        whole = [one for one in glances if not one.corrupt and one.decoded_s < until_s]
        shown = sorted(whole, key=lambda one: one.decoded_s) or [Glance(from_s, from_s)]
        ends_s = [*(one.decoded_s for one in shown[1:]), until_s]
        self._ages_s = [
            (max(one.decoded_s, from_s) - one.captured_s, min(end_s, until_s) - one.captured_s)
            for one, end_s in zip(shown, ends_s, strict=True)
            if min(end_s, until_s) > max(one.decoded_s, from_s)
        ]
        """Of each picture, when it came and when the next one did."""

    @property
    def worst_ms(self) -> float:
        """Highest age."""
        return max(last_s for _, last_s in self._ages_s) * 1000

    @property
    def p95_ms(self) -> float:
        """Age that was not exceeded in 95 % of the time."""
        low_s, high_s = min(first_s for first_s, _ in self._ages_s), self.worst_ms / 1000
        whole_s = sum(last_s - first_s for first_s, last_s in self._ages_s)
        for _ in range(_HALVINGS):
            limit_s = (low_s + high_s) / 2
            if self._below_s(limit_s) < 0.95 * whole_s:
                low_s = limit_s
            else:
                high_s = limit_s
        return high_s * 1000

    def _below_s(self, limit_s: float) -> float:
        """Returns for how long the age was below a limit."""
        return sum(max(0.0, min(last_s, limit_s) - first_s) for first_s, last_s in self._ages_s)


def slope(counts: Sequence[float], figures: Sequence[float]) -> float:
    """Returns the slope of the line of least squares: how much a figure grows with each unit of the count."""
    return statistics.linear_regression(counts, figures).slope
