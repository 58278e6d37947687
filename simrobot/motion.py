"""Motion of the robot and of the objects that it sees, as pure functions of time."""

import math
from dataclasses import dataclass

from simrobot.base import Twist

FRAME_WIDTH_PX = 1280
FRAME_HEIGHT_PX = 720

_CLASSES = ((0, "person"), (2, "car"), (16, "dog"), (39, "bottle"))
_LIPO_EMPTY_V, _LIPO_FULL_V = 13.2, 16.8


@dataclass(slots=True)
class Pose:
    """Pose in the odometry frame, in metres and radians."""

    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0

    def drive(self, velocity: Twist, duration_s: float) -> None:
        """Moves by `duration_s` at this velocity: the midpoint rule, with the heading of half the time."""
        middle = self.heading_rad + velocity.wz_rad_s * duration_s / 2
        forward_m, left_m = velocity.vx_mps * duration_s, velocity.vy_mps * duration_s
        self.x_m += forward_m * math.cos(middle) - left_m * math.sin(middle)
        self.y_m += forward_m * math.sin(middle) + left_m * math.cos(middle)
        self.heading_rad = math.remainder(self.heading_rad + velocity.wz_rad_s * duration_s, math.tau)


@dataclass(frozen=True, slots=True)
class Box:
    """Bounding box of one object, in pixels."""

    track_id: str
    class_id: int
    class_name: str
    score: float
    center_x_px: float
    center_y_px: float
    width_px: float
    height_px: float


def boxes_at(time_s: float, count: int) -> list[Box]:
    """Returns `count` boxes that drift over the frame, each on its own path and always entirely inside."""
    return [_box(time_s, number) for number in range(count)]


def _box(time_s: float, number: int) -> Box:
    class_id, class_name = _CLASSES[number % len(_CLASSES)]
    width, height = 60.0 + 20 * (number % 7), 80.0 + 25 * (number % 5)
    return Box(
        track_id=str(number + 1),
        class_id=class_id,
        class_name=class_name,
        score=0.75 + 0.2 * math.sin(time_s + number),
        center_x_px=_to_and_fro(time_s * (40 + 11 * (number % 9)) + 97 * number, width / 2, FRAME_WIDTH_PX),
        center_y_px=_to_and_fro(time_s * (25 + 7 * (number % 6)) + 61 * number, height / 2, FRAME_HEIGHT_PX),
        width_px=width,
        height_px=height,
    )


def _to_and_fro(way: float, margin: float, size: float) -> float:
    """Returns the position after `way` pixels of travel between two walls, `margin` inside the edges."""
    room = size - 2 * margin
    return margin + room - abs(way % (2 * room) - room)


def pack_voltage(percent: float) -> float:
    """Returns the terminal voltage of a four-cell lithium pack in volts; a linear approximation."""
    return _LIPO_EMPTY_V + (_LIPO_FULL_V - _LIPO_EMPTY_V) * percent / 100
