"""What the practice robot's camera sees: a floor with a grid, and posts to drive around. Pure."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

_CAMERA_M: Final = 0.30
"""Height above the floor."""
_FOCAL: Final = 0.6
"""Focal length, as a share of the picture's width: a field of view of 80 degrees."""
_HORIZON: Final = 0.42
"""Below the upper edge, as a share of the picture's height."""
_NEAR_M: Final = 0.12
_GRID_M: Final = 0.5
_GRID_LINES: Final = 13
"""To each side of the robot."""
_POST_M: Final = 0.7
_POST_THICK_M: Final = 0.08
_FLOOR: Final = "#5f6b66", 0.01
"""Colour of its lines, and their width in metres."""
_POSTS: Final = (
    (1.5, 0.6, "#E69F00"),
    (1.5, -0.6, "#E69F00"),
    (3.0, 1.0, "#56B4E9"),
    (3.5, -1.0, "#56B4E9"),
    (5.0, 0.0, "#CC79A7"),
    (-2.0, 1.5, "#009E73"),
    (-2.0, -1.5, "#009E73"),
    (0.0, 3.0, "#F0E442"),
    (0.0, -3.0, "#F0E442"),
)
"""x, y in metres, and colour."""


@dataclass(frozen=True, slots=True)
class View:
    """Where the camera is: metres and radians in the odometry frame."""

    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0


class Stroke(NamedTuple):
    """A line of the picture, in pixels; x right, y down."""

    x1: float
    y1: float
    x2: float
    y2: float
    colour: str
    width_px: float


def seen(view: View, width_px: int, height_px: int) -> list[Stroke]:
    """Returns the picture from a view, the farthest first."""
    size_px = width_px, height_px
    strokes = [
        stroke
        for start, end in _grid(view)
        if (stroke := _stroke(view, (*start, 0.0), (*end, 0.0), size_px, _FLOOR))
    ]
    posts = sorted(_POSTS, key=lambda post: -math.hypot(post[0] - view.x_m, post[1] - view.y_m))
    for x_m, y_m, colour in posts:
        post = _stroke(view, (x_m, y_m, 0.0), (x_m, y_m, _POST_M), size_px, (colour, _POST_THICK_M))
        if post:
            strokes.append(post)
    return strokes


def _grid(view: View) -> Iterator[tuple[tuple[float, float], tuple[float, float]]]:
    """Yields the grid's lines around the robot; they stay where they are on the floor."""
    middle_x, middle_y = (round(each / _GRID_M) * _GRID_M for each in (view.x_m, view.y_m))
    reach = _GRID_LINES * _GRID_M
    for number in range(-_GRID_LINES, _GRID_LINES + 1):
        x, y = middle_x + number * _GRID_M, middle_y + number * _GRID_M
        yield (x, middle_y - reach), (x, middle_y + reach)
        yield (middle_x - reach, y), (middle_x + reach, y)


def _stroke(
    view: View,
    start: tuple[float, float, float],
    end: tuple[float, float, float],
    size_px: tuple[int, int],
    paint: tuple[str, float],
) -> Stroke | None:
    """Returns a line in space as the camera sees it; None where it is behind the camera.

    Args:
        view: of the camera.
        start: x, y and height of one end, in metres.
        end: of the other.
        size_px: width and height of the picture.
        paint: colour of the line, and its width in metres.
    """
    (width_px, height_px), (colour, thick_m) = size_px, paint
    near, far = sorted((_from_camera(view, start), _from_camera(view, end)))
    if far[0] <= _NEAR_M:
        return None
    if near[0] < _NEAR_M:
        share = (_NEAR_M - near[0]) / (far[0] - near[0])
        forward, left, up = (a + (b - a) * share for a, b in zip(near, far, strict=True))
        near = forward, left, up
    focal_px = _FOCAL * width_px
    points = [
        (width_px / 2 - focal_px * left / forward, _HORIZON * height_px - focal_px * up / forward)
        for forward, left, up in (near, far)
    ]
    return Stroke(*points[0], *points[1], colour, max(1.0, focal_px * thick_m / far[0]))


def _from_camera(view: View, point: tuple[float, float, float]) -> tuple[float, float, float]:
    """Returns a point as metres forward, left and up of the camera."""
    x, y = point[0] - view.x_m, point[1] - view.y_m
    cosine, sine = math.cos(view.heading_rad), math.sin(view.heading_rad)
    return x * cosine + y * sine, y * cosine - x * sine, point[2] - _CAMERA_M
