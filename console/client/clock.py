"""The offset between this computer's monotonic clock and the robot's, with a bound on its error.

An answer to Ping was made at some instant between the request's leaving and the answer's coming. So the
offset is known to half the time the call took, whatever the link did; the quickest of the last calls gives
the best bound. As time passes the bound grows, because no two clocks run equally fast.
"""

from collections import deque
from dataclasses import dataclass
from typing import Final

from console.client.results import RobotTime

_KEPT: Final = 16
"""Readings among which the best is looked for."""
_DRIFT: Final = 200e-6
"""How much faster one quartz may run than another: 100 ppm each, twice what data sheets allow."""
_NS_PER_S: Final = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Offset:
    """What to add to this computer's monotonic clock to get the robot's, at one instant.

    Attributes:
        seconds: robot minus local.
        error_s: the true offset is at most so far from it.
    """

    seconds: float
    error_s: float


@dataclass(frozen=True, slots=True)
class _Reading:
    at_s: float
    offset_s: float
    error_s: float

    def error_at(self, now_s: float) -> float:
        return self.error_s + _DRIFT * max(0.0, now_s - self.at_s)


class Clock:
    """Learns from every Ping. Instants of this computer are those of `time.monotonic()`, in s."""

    def __init__(self) -> None:
        self._readings: deque[_Reading] = deque(maxlen=_KEPT)
        self._boot_id: str | None = None

    def note(self, sent_s: float, robot: RobotTime, received_s: float) -> None:
        """Takes in one call: when it left, what the robot's clocks showed, when the answer came."""
        if robot.boot_id != self._boot_id:
            # The robot's computer was started anew, and so was its clock.
            self._readings.clear()
            self._boot_id = robot.boot_id
        half_s = (received_s - sent_s) / 2
        middle_s = sent_s + half_s
        self._readings.append(_Reading(middle_s, robot.monotonic_ns / _NS_PER_S - middle_s, half_s))

    def offset(self, now_s: float) -> Offset | None:
        """The best that is known at `now_s`; None before the first answer."""
        if not self._readings:
            return None
        best = min(self._readings, key=lambda reading: reading.error_at(now_s))
        return Offset(best.offset_s, best.error_at(now_s))

    def local_s(self, robot_monotonic_ns: int, now_s: float) -> float | None:
        """An instant of the robot on this computer's clock; as exact as `offset` says."""
        offset = self.offset(now_s)
        return None if offset is None else robot_monotonic_ns / _NS_PER_S - offset.seconds
