"""State of the simulated robot: its behaviour integrated over time. Knows no ROS."""

from dataclasses import dataclass
from typing import Any

from simrobot.base import Base, Twist
from simrobot.behaviour import Behaviour
from simrobot.motion import Box, Pose, boxes_at


@dataclass(frozen=True, slots=True)
class VisionCounts:
    """Counters of the vision process since the start."""

    produced: int
    infer_errors: int


class Robot:
    """The robot at a given time. Every `now_s` is a monotonic time in seconds that the caller reads.

    Args:
        behaviour: at the start.
        now_s: time of the start.
        base: that moves it; without one it moves as its behaviour says.
    """

    def __init__(self, behaviour: Behaviour, now_s: float, base: Base | None = None) -> None:
        self.behaviour = behaviour
        self._base = base
        self.pose = Pose()
        self._started_s = self._moved_s = now_s
        self._charge_set_s = now_s
        self._infer_errors = 0.0
        self._mode_seen: str | None = None

    def change(self, fields: dict[str, Any], now_s: float) -> Behaviour:
        """Replaces `fields` of the behaviour and returns the result.

        Raises:
            UserError: a field is unknown or a value is not allowed; nothing changes.
        """
        # The present charge, so that a change of another field does not reset it.
        changed = self.behaviour.changed({"battery_percent": self.battery_percent(now_s)} | fields)
        self.advance(now_s)
        self._charge_set_s = now_s
        self.behaviour = changed
        return changed

    def advance(self, now_s: float) -> None:
        """Integrates pose and counters up to `now_s`."""
        passed_s = max(0.0, now_s - self._moved_s)
        self.pose.drive(self.velocity(now_s), passed_s)
        self._infer_errors += self.behaviour.infer_errors_per_s * passed_s
        self._moved_s += passed_s

    def velocity(self, now_s: float) -> Twist:
        """Returns how it moves."""
        if self._base:
            return self._base.velocity(now_s)
        return Twist(vx_mps=self.behaviour.speed_mps, wz_rad_s=self.behaviour.turn_rad_s)

    def battery_percent(self, now_s: float) -> float:
        """Returns the remaining charge, 0 to 100."""
        drained = self.behaviour.battery_drain_percent_per_s * (now_s - self._charge_set_s)
        return min(max(self.behaviour.battery_percent - drained, 0.0), 100.0)

    def boxes(self, now_s: float) -> list[Box]:
        """Returns the objects that the camera sees."""
        return boxes_at(now_s - self._started_s, self.behaviour.detection_count)

    def vision_counts(self, now_s: float, frames_per_s: float) -> VisionCounts:
        """Returns the counters of a vision process with this frame rate."""
        self.advance(now_s)
        return VisionCounts(
            produced=int((now_s - self._started_s) * frames_per_s), infer_errors=int(self._infer_errors)
        )

    def mode_changed(self) -> bool:
        """Returns whether the mode differs from the one at the previous call."""
        seen, self._mode_seen = self._mode_seen, self.behaviour.mode
        return seen != self.behaviour.mode
