"""Where the simulated things are at a given time. Pure: time in, numbers out."""

import math
from dataclasses import dataclass

PICTURE_WIDTH_PX = 1280
PICTURE_HEIGHT_PX = 720

_CLASSES = ((0, "person"), (2, "car"), (16, "dog"), (39, "bottle"))
_LIPO_EMPTY_V, _LIPO_FULL_V = 13.2, 16.8


@dataclass(slots=True)
class Pose:
    """Where the robot stands: metres and radians in the odometry frame."""

    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0

    def drive(self, speed_mps: float, turn_rad_s: float, duration_s: float) -> None:
        """Moves along the arc that both rates describe in `duration_s`."""
        middle = self.heading_rad + turn_rad_s * duration_s / 2
        self.x_m += speed_mps * math.cos(middle) * duration_s
        self.y_m += speed_mps * math.sin(middle) * duration_s
        self.heading_rad = math.remainder(self.heading_rad + turn_rad_s * duration_s, math.tau)


@dataclass(frozen=True, slots=True)
class Box:
    """One object in the picture, in pixels."""

    track_id: str
    class_id: int
    class_name: str
    score: float
    center_x_px: float
    center_y_px: float
    width_px: float
    height_px: float


def boxes_at(time_s: float, count: int) -> list[Box]:
    """`count` boxes that drift over the picture, each on its own path and always wholly inside."""
    return [_box(time_s, number) for number in range(count)]


def _box(time_s: float, number: int) -> Box:
    class_id, class_name = _CLASSES[number % len(_CLASSES)]
    width, height = 60.0 + 20 * (number % 7), 80.0 + 25 * (number % 5)
    return Box(
        track_id=str(number + 1),
        class_id=class_id,
        class_name=class_name,
        score=0.75 + 0.2 * math.sin(time_s + number),
        center_x_px=_to_and_fro(time_s * (40 + 11 * (number % 9)) + 97 * number, width / 2, PICTURE_WIDTH_PX),
        center_y_px=_to_and_fro(
            time_s * (25 + 7 * (number % 6)) + 61 * number, height / 2, PICTURE_HEIGHT_PX
        ),
        width_px=width,
        height_px=height,
    )


def _to_and_fro(way: float, margin: float, size: float) -> float:
    """A point that has gone `way` pixels between two walls, `margin` off the picture's edges."""
    room = size - 2 * margin
    return margin + room - abs(way % (2 * room) - room)


def pack_voltage(percent: float) -> float:
    """Terminal voltage of a four-cell lithium pack, in volts; linear is close enough to look at."""
    return _LIPO_EMPTY_V + (_LIPO_FULL_V - _LIPO_EMPTY_V) * percent / 100
