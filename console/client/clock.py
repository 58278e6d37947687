"""The offset between this computer's monotonic clock and the robot's, with a bound on its error.

The robot reads its clock between the departure of a Ping and the arrival of its answer, so the offset is
known to half the round trip, however asymmetric the link is (Cristian's algorithm). The fastest of the last
calls gives the best bound, which grows with time, because no two clocks run at the same rate.
"""

from collections import deque
from dataclasses import dataclass
from typing import Final

from console.client.results import RobotTime

_KEPT: Final = 16
"""Number of the newest readings that the best is chosen from."""
_DRIFT: Final = 200e-6
"""Largest difference in rate of two quartz clocks: 100 ppm each, twice what data sheets allow."""
_NS_PER_S: Final = 1_000_000_000
_RESOLUTION_S: Final = 1e-6
"""Of what is computed here with times of up to some years."""


@dataclass(frozen=True, slots=True)
class Offset:
    """The robot's monotonic clock minus this computer's, at one instant.

    Attributes:
        seconds: The estimate.
        error_s: Bound of its error.
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

    def agrees_with(self, later: "_Reading") -> bool:
        """Whether there is an offset within the bounds of both."""
        bound_s = self.error_at(later.at_s) + later.error_s + _RESOLUTION_S
        return abs(self.offset_s - later.offset_s) <= bound_s


class Clock:
    """Estimates the offset from Ping calls. Local times are those of `time.monotonic()`, in seconds."""

    def __init__(self) -> None:
        self._readings: deque[_Reading] = deque(maxlen=_KEPT)
        self._boot_id: str | None = None

    def note(self, sent_s: float, robot: RobotTime, received_s: float) -> None:
        """Adds one call: its departure, the robot's time, the arrival of the answer."""
        if robot.boot_id != self._boot_id:
            # The robot's computer was rebooted, and its clock started again.
            self._readings.clear()
            self._boot_id = robot.boot_id
        half_s = (received_s - sent_s) / 2
        middle_s = sent_s + half_s
        new = _Reading(middle_s, robot.monotonic_ns / _NS_PER_S - middle_s, half_s)
        # A computer's monotonic clock stands still while it is suspended (clock_gettime(2)): what was read
        # before then contradicts what is read after.
        kept = [each for each in self._readings if each.agrees_with(new)]
        self._readings = deque([*kept, new], maxlen=_KEPT)

    def offset(self, now_s: float) -> Offset | None:
        """Returns the best estimate at `now_s`; None before the first answer."""
        # A copy: another thread may drop them all meanwhile.
        readings = tuple(self._readings)
        if not readings:
            return None
        best = min(readings, key=lambda reading: reading.error_at(now_s))
        return Offset(best.offset_s, best.error_at(now_s))

    def local_s(self, robot_monotonic_ns: int, now_s: float) -> float | None:
        """Returns a time of the robot on this computer's clock, as exact as `offset`; None without one."""
        offset = self.offset(now_s)
        return None if offset is None else robot_monotonic_ns / _NS_PER_S - offset.seconds
