import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simrobot.base import Twist
from simrobot.motion import FRAME_HEIGHT_PX, FRAME_WIDTH_PX, Pose, boxes_at, pack_voltage


def test_a_full_turn_leads_back_to_the_start() -> None:
    pose = Pose()
    steps, speed, turn = 1000, 0.5, 0.25
    for _ in range(steps):
        pose.drive(Twist(vx_mps=speed, wz_rad_s=turn), math.tau / turn / steps)
    assert math.hypot(pose.x_m, pose.y_m) < 1e-6
    assert abs(pose.heading_rad) < 1e-6


def test_half_a_turn_is_one_diameter_away() -> None:
    pose = Pose()
    for _ in range(1000):
        pose.drive(Twist(vx_mps=0.5, wz_rad_s=0.25), math.pi / 0.25 / 1000)
    assert math.hypot(pose.x_m, pose.y_m) == pytest.approx(4.0, abs=1e-3)


@given(time_s=st.floats(0, 1e6), count=st.integers(0, 200))
def test_boxes_stay_inside_the_frame(time_s: float, count: int) -> None:
    boxes = boxes_at(time_s, count)
    assert len(boxes) == count
    for box in boxes:
        assert box.width_px / 2 - 1e-3 <= box.center_x_px <= FRAME_WIDTH_PX - box.width_px / 2 + 1e-3
        assert box.height_px / 2 - 1e-3 <= box.center_y_px <= FRAME_HEIGHT_PX - box.height_px / 2 + 1e-3
        assert 0 <= box.score <= 1


def test_boxes_move() -> None:
    assert boxes_at(1.0, 3) != boxes_at(1.1, 3)


def test_a_full_pack_has_more_volts_than_an_empty_one() -> None:
    assert pack_voltage(0) == pytest.approx(13.2)
    assert pack_voltage(100) == pytest.approx(16.8)


def test_sideways_is_to_the_left_of_the_heading() -> None:
    pose = Pose(heading_rad=math.pi / 2)
    pose.drive(Twist(vy_mps=0.5), 2)
    assert (pose.x_m, pose.y_m) == pytest.approx((-1, 0), abs=1e-9)
