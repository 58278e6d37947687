"""The simulated robot's state: what its behaviour has led to until now. Knows no ROS."""

from dataclasses import dataclass
from typing import Any

from simrobot.behaviour import Behaviour
from simrobot.motion import Box, Pose, boxes_at


@dataclass(frozen=True, slots=True)
class VisionCounts:
    """What the vision process has counted since the start."""

    produced: int
    infer_errors: int


class Robot:
    """Advances by `now_s`, a monotonic time that its caller reads; every question is about that time.

    Args:
        behaviour: how it starts.
        now_s: when it starts.
    """

    def __init__(self, behaviour: Behaviour, now_s: float) -> None:
        self.behaviour = behaviour
        self.pose = Pose()
        self._started_s = self._moved_s = now_s
        self._charge_set_s = now_s
        self._infer_errors = 0.0
        self._mode_told: str | None = None

    def change(self, wish: dict[str, Any], now_s: float) -> Behaviour:
        """Behaves differently from now on: `wish` names the fields that change.

        Raises:
            UserError: an unknown field or a value that is not allowed; nothing changes.
        """
        changed = self.behaviour.changed({"battery_percent": self.battery_percent(now_s)} | wish)
        self.advance(now_s)
        self._charge_set_s = now_s
        self.behaviour = changed
        return changed

    def advance(self, now_s: float) -> None:
        """Lives on until `now_s`."""
        passed_s = max(0.0, now_s - self._moved_s)
        self.pose.drive(self.behaviour.speed_mps, self.behaviour.turn_rad_s, passed_s)
        self._infer_errors += self.behaviour.infer_errors_per_s * passed_s
        self._moved_s += passed_s

    def battery_percent(self, now_s: float) -> float:
        """The charge that is left, 0 to 100."""
        drained = self.behaviour.battery_drain_percent_per_s * (now_s - self._charge_set_s)
        return min(max(self.behaviour.battery_percent - drained, 0.0), 100.0)

    def boxes(self, now_s: float) -> list[Box]:
        """What the camera sees."""
        return boxes_at(now_s - self._started_s, self.behaviour.detection_count)

    def vision_counts(self, now_s: float, pictures_per_s: float) -> VisionCounts:
        """What a vision process at this rate has counted so far."""
        self.advance(now_s)
        return VisionCounts(
            produced=int((now_s - self._started_s) * pictures_per_s), infer_errors=int(self._infer_errors)
        )

    def news_of_mode(self) -> bool:
        """Whether the mode is another than at the last question."""
        told, self._mode_told = self._mode_told, self.behaviour.mode
        return told != self.behaviour.mode
