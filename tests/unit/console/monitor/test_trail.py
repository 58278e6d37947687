"""The way driven, by dead reckoning from velocities."""

import math

import pytest

from console.client.results import Odometry
from console.monitor.trail import Trail

STEP_S = 0.1


def moving(vx: float = 0.0, vy: float = 0.0, wz: float = 0.0, *, stale: bool = False) -> Odometry:
    return Odometry(
        available=True,
        stale=stale,
        age_ms=20,
        linear_speed_mps=math.hypot(vx, vy),
        angular_speed_rad_s=abs(wz),
        vx_mps=vx,
        vy_mps=vy,
        wz_rad_s=wz,
    )


def driven(odometry: Odometry, seconds: float, trail: Trail | None = None, start_s: float = 100.0) -> Trail:
    trail = trail or Trail()
    for step in range(round(seconds / STEP_S) + 1):
        trail.add(odometry, start_s + step * STEP_S)
    return trail


def test_straight_ahead() -> None:
    pose = driven(moving(0.5), 4).pose
    assert (pose.x_m, pose.y_m, pose.heading_rad) == pytest.approx((2.0, 0.0, 0.0))


def test_a_robot_with_mecanum_wheels_moves_sideways() -> None:
    assert driven(moving(vy=0.5), 2).pose.y_m == pytest.approx(1.0)


def test_a_circle_ends_where_it_began() -> None:
    trail = driven(moving(0.5, wz=math.tau / 10), 10)
    assert (trail.pose.x_m, trail.pose.y_m) == pytest.approx((0, 0), abs=0.01)
    radius_m = 0.5 / (math.tau / 10)
    assert max(pose.y_m for pose in trail.points) == pytest.approx(2 * radius_m, abs=0.01)


def test_after_a_left_turn_ahead_is_left() -> None:
    trail = driven(moving(wz=math.pi / 2), 1)
    driven(moving(1.0), 2, trail, 101.1)
    assert trail.pose.y_m == pytest.approx(2.0, abs=0.15)
    assert abs(trail.pose.x_m) < 0.15


def test_the_same_measurement_counts_once() -> None:
    trail = Trail()
    for _ in range(50):
        trail.add(moving(1.0), 100.0)
    assert not trail.moved


@pytest.mark.parametrize(
    "unusable", [moving(1.0, stale=True), moving(math.nan), moving(math.inf)], ids=["stale", "nan", "inf"]
)
def test_what_is_not_a_velocity_of_now_moves_nothing(unusable: Odometry) -> None:
    assert not driven(unusable, 5).moved


def test_over_a_gap_the_way_begins_anew() -> None:
    trail = driven(moving(1.0), 5)
    assert trail.pose.x_m == pytest.approx(5.0)
    trail.add(moving(1.0), 200.0)
    assert not trail.moved


def test_a_status_that_is_only_repeated_every_second_goes_on() -> None:
    trail = Trail()
    for second in range(5):
        trail.add(moving(1.0), 100.0 + second)
    assert trail.pose.x_m == pytest.approx(4.0)


def test_a_long_day_is_bounded() -> None:
    assert len(driven(moving(1.0), 600).points) <= 1001
