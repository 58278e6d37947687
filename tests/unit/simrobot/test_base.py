"""The double of the mecanum base, with the firmware's defects."""

import pytest

from simrobot.base import STILL, Base, Heard, Twist, clamped
from simrobot.behaviour import Behaviour
from simrobot.robot import Robot

FORWARD = Twist(vx_mps=0.2)


def test_it_stops_a_second_after_the_last_velocity() -> None:
    base = Base()
    assert base.velocity(5.0) == STILL
    base.receive(FORWARD, 10.0)
    assert base.velocity(10.999) == FORWARD
    assert base.velocity(11.0) == STILL


@pytest.mark.parametrize(("last", "revived"), [(FORWARD, FORWARD), (STILL, STILL)])
def test_a_last_velocity_other_than_zero_revives_after_71_6_minutes(last: Twist, revived: Twist) -> None:
    base, wrap_s = Base(), 2**32 / 1e6
    assert wrap_s / 60 == pytest.approx(71.6, abs=0.05)
    base.receive(last, 10.0)
    assert base.velocity(10.0 + wrap_s - 0.01) == STILL
    assert base.velocity(10.0 + wrap_s + 0.01) == revived
    assert base.velocity(10.0 + wrap_s + 1.01) == STILL


def test_a_wheel_at_its_limit_bends_the_direction() -> None:
    inside = clamped(Twist(0.1, 0.05, 0.3))
    assert (inside.vx_mps, inside.vy_mps, inside.wz_rad_s) == pytest.approx((0.1, 0.05, 0.3))
    bent = clamped(Twist(0.3, 0.1, 0.0))
    assert bent.vx_mps == pytest.approx((0.2 + 0.264) / 2)
    assert bent.vy_mps == pytest.approx((0.264 - 0.2) / 2)


def test_the_robot_goes_where_its_base_moves() -> None:
    base = Base()
    robot = Robot(Behaviour(), 100.0, base)
    robot.advance(101.0)
    assert robot.pose.x_m == 0, "not as its behaviour says"
    for tick in range(100):
        base.receive(Twist(vx_mps=0.1, vy_mps=-0.1), 101.0 + tick / 100)
        robot.advance(101.0 + (tick + 1) / 100)
    assert (robot.pose.x_m, robot.pose.y_m) == pytest.approx((0.1, -0.1))


def test_it_remembers_when_zero_followed_its_last_motion() -> None:
    base = Base()
    base.receive(STILL, 9.0)
    assert (base.heard,) == (None,)
    base.receive(FORWARD, 10.0)
    base.receive(FORWARD, 10.02)
    assert base.heard == Heard(10.02)
    base.receive(STILL, 10.1)
    base.receive(STILL, 12.0)
    assert base.heard == Heard(10.02, 10.1), "the first zero counts"
    base.receive(FORWARD, 13.0)
    assert base.heard == Heard(13.0)
