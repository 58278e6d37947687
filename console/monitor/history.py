"""History of a few metrics: the last two minutes, in slots of half a second."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

from console.client import SystemStatus
from console.client.results import Freshness

SPAN_S: Final = 120.0
STEP_S: Final = 0.5
SLOTS: Final = int(SPAN_S / STEP_S)


@dataclass(frozen=True, slots=True)
class Metric:
    """A plotted metric.

    Args:
        title: its name.
        unit: of its values.
        bottom: lower end of the scale.
        top: upper end of the scale; it grows when values do not fit.
        digits: after the decimal point.
    """

    title: str
    unit: str
    bottom: float
    top: float
    digits: int = 0


METRICS: Final = (
    Metric("Picture age", "ms", 0, 200),
    Metric("Video rate", "fps", 0, 40),
    Metric("Video bit rate", "kbit/s", 0, 1000),
    Metric("Video round trip", "ms", 0, 20, digits=1),
    Metric("CPU load", "%", 0, 100),
    Metric("CPU temperature", "°C", 20, 100),
)
Values: TypeAlias = tuple[float | None, ...]
"""One for each of METRICS; None where it is unknown."""
NOTHING: Final[Values] = (None,) * len(METRICS)


def values_of(picture_age_ms: float | None, status: SystemStatus | None) -> Values:
    """Returns the metrics of one moment; stale ones are None.

    Args:
        picture_age_ms: the largest age of the picture since the moment before.
        status: the robot's; None while it is not known.
    """
    if status is None:
        return (picture_age_ms, *NOTHING[1:])
    measured, compute = status.preview.measured, status.platform.compute
    video = (measured.fps, measured.bitrate_kbps, measured.worst_rtt_ms)
    computer = (compute.cpu_percent, compute.cpu_temperature_c)
    return (
        picture_age_ms,
        *(video if measured.freshness is Freshness.FRESH else (None,) * 3),
        *(computer if compute.freshness is Freshness.FRESH else (None,) * 2),
    )


class History:
    """Ring buffer of SLOTS slots. Time without a record is a gap, not a line between its ends."""

    def __init__(self) -> None:
        self._slots: list[Values] = [NOTHING] * SLOTS
        self._newest = -1

    def record(self, now_s: float, values: Values) -> None:
        """Records the values of this moment, on the monotonic clock. The last of a slot counts."""
        slot = int(now_s / STEP_S)
        for skipped in range(max(self._newest + 1, slot - SLOTS + 1), slot):
            self._slots[skipped % SLOTS] = NOTHING
        self._newest = slot
        self._slots[slot % SLOTS] = values

    def series(self, index: int) -> list[float | None]:
        """Returns the values of METRICS[index], oldest first, the newest at the end."""
        first = self._newest + 1
        return [self._slots[(first + offset) % SLOTS][index] for offset in range(SLOTS)]


def top_of_scale(metric: Metric, series: Sequence[float | None]) -> float:
    """Returns the upper end of the scale: the metric's own, or a round number above the highest value."""
    highest = max((value for value in series if value is not None), default=metric.top)
    if highest <= metric.top:
        return metric.top
    step = 1.0
    while True:
        for digit in (1, 1.5, 2, 3, 4, 5, 6, 8):
            if step * digit >= highest:
                return step * digit
        step *= 10
