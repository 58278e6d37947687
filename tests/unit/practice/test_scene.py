"""What the practice robot's camera sees."""

import math

import pytest

from practice.scene import Stroke, View, seen

WIDTH, HEIGHT = 640, 360
ORANGE = "#E69F00"


def posts(view: View, colour: str = ORANGE) -> list[Stroke]:
    return [each for each in seen(view, WIDTH, HEIGHT) if each.colour == colour]


def test_two_posts_ahead_stand_left_and_right_of_the_middle() -> None:
    left, right = sorted(posts(View()))
    assert left.x1 < WIDTH / 2 < right.x1
    assert WIDTH / 2 - left.x1 == pytest.approx(right.x1 - WIDTH / 2)


def test_a_turn_to_the_left_moves_them_to_the_right() -> None:
    before, after = posts(View())[0], posts(View(heading_rad=0.1))[0]
    assert after.x1 > before.x1


def test_they_grow_as_the_robot_comes_nearer() -> None:
    far, near = (posts(View(x_m=x_m))[0] for x_m in (0.0, 0.8))
    assert abs(near.y1 - near.y2) > 1.5 * abs(far.y1 - far.y2)
    assert near.width_px > far.width_px


def test_what_is_behind_the_camera_is_not_seen() -> None:
    assert not posts(View(heading_rad=math.pi))
    assert len(posts(View(heading_rad=math.pi), "#009E73")) == 2


def test_the_floors_lines_stay_on_the_floor_while_the_robot_drives() -> None:
    """A grid that moved with the robot would show no motion."""
    at_rest, ahead = (set(seen(View(x_m=x_m), WIDTH, HEIGHT)) for x_m in (0.0, 0.1))
    assert at_rest != ahead


@pytest.mark.parametrize("heading", [0.0, 1.0, -2.5])
def test_every_line_can_be_painted(heading: float) -> None:
    for stroke in seen(View(3.0, 1.0, heading), WIDTH, HEIGHT):
        assert all(map(math.isfinite, stroke[:4]))
        assert stroke.width_px >= 1
