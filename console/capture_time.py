"""The capture time of a frame, from its presentation time stamp. Pure.

A robot's stream runs on its monotonic clock: a frame was captured at the PTS of its access unit plus a
constant that the stream's endpoint names. A PTS has 33 bits of 90 kHz (ISO/IEC 13818-1 2.4.3.7), so it wraps
every 26.5 hours; which turn is meant follows from the robot's present time.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

WRAP_TICKS: Final = 1 << 33


def ticks_to_ns(ticks: int) -> int:
    """Returns ticks of 90 kHz in nanoseconds, rounded down."""
    return ticks * 100_000 // 9


def ns_to_ticks(time_ns: int) -> int:
    """Returns nanoseconds in ticks of 90 kHz, rounded to the nearest: the inverse of `ticks_to_ns`."""
    return (time_ns * 9 + 50_000) // 100_000


def capture_ns(pts_ticks: int, offset_ns: int, robot_now_ns: int) -> int:
    """Returns when a frame was captured, in ns on the robot's monotonic clock.

    Args:
        pts_ticks: PTS; only its lower 33 bits count.
        offset_ns: capture time minus PTS, from the stream's endpoint.
        robot_now_ns: the robot's monotonic clock now, true to 13 hours.
    """
    now_ticks = ns_to_ticks(robot_now_ns - offset_ns)
    return ticks_to_ns(nearest(pts_ticks, now_ticks)) + offset_ns


def nearest(pts_ticks: int, reference_ticks: int) -> int:
    """Returns the number with the lower 33 bits of `pts_ticks` that is nearest to a reference."""
    half = WRAP_TICKS // 2
    return reference_ticks + (pts_ticks - reference_ticks + half) % WRAP_TICKS - half


class Unwrapped:
    """Follows the PTS of one stream over its wraps."""

    def __init__(self) -> None:
        self._latest: int | None = None

    def ticks(self, pts_ticks: int) -> int:
        """Returns a PTS without the wrap, in ticks; nearest to the one before it.

        The first one is above 0; one may be below after a stream has run backwards for hours.
        """
        reference = pts_ticks + WRAP_TICKS if self._latest is None else self._latest
        self._latest = nearest(pts_ticks, reference)
        return self._latest


@dataclass(frozen=True, slots=True)
class CaptureClock:
    """Capture times of one stream.

    Args:
        offset_ns: capture time minus PTS, from the stream's endpoint.
        robot_now_ns: reads the estimate of the robot's monotonic clock; None while there is none.
    """

    offset_ns: int
    robot_now_ns: Callable[[], int | None]

    def capture_ns(self, pts_ticks: int) -> int | None:
        """Returns the capture time of a PTS; None while the robot's clock is unknown."""
        now_ns = self.robot_now_ns()
        return None if now_ns is None else capture_ns(pts_ticks, self.offset_ns, now_ns)

    def age_s(self, pts_ticks: int) -> float | None:
        """Returns the age of a frame now; None while the robot's clock is unknown."""
        now_ns = self.robot_now_ns()
        if now_ns is None:
            return None
        return (now_ns - capture_ns(pts_ticks, self.offset_ns, now_ns)) / 1e9
