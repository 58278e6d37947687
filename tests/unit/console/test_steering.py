"""From keys and sticks to velocities."""

from dataclasses import replace

import pytest

from console.client import Supervision
from console.client.results import DriveLimits
from console.steering import LETTERS, Direction, Speeds, Steering, permitted, steering_of

LIMITS = DriveLimits(
    max_vx_mps=0.35,
    max_vy_mps=0.25,
    max_wz_rad_s=0.8,
    acceleration_mps2=0.5,
    acceleration_rad_s2=1.0,
    max_picture_age_ms=600,
    picture_travel_m=0.1,
    line_of_sight=True,
    line_of_sight_mps=0.15,
    line_of_sight_rad_s=0.4,
)


def test_keys_add_up_and_opposite_ones_cancel_out() -> None:
    assert steering_of([]) is None
    assert steering_of([Direction.FORWARD, Direction.TURN_LEFT]) == (1, 0, 1)
    assert steering_of([Direction.FORWARD, Direction.BACK]) == (0, 0, 0), "held, without a velocity"
    assert steering_of(list(Direction)) == (0, 0, 0)


def test_two_keys_of_one_direction_are_one() -> None:
    assert steering_of([Direction.FORWARD, Direction.FORWARD, Direction.TURN_LEFT]) == (1, 0, 1)


def test_each_direction_has_a_letter_of_its_own() -> None:
    assert sorted(LETTERS.values(), key=lambda each: each.name) == sorted(
        Direction, key=lambda each: each.name
    )


@pytest.mark.parametrize("supervision", [Supervision.PICTURE, Supervision.UNKNOWN])
def test_a_share_of_1_is_what_the_robot_accepts(supervision: Supervision) -> None:
    assert permitted(LIMITS, supervision) == (0.35, 0.25, 0.8)


def test_by_line_of_sight_it_is_what_that_permits_and_no_more_than_the_robot_accepts() -> None:
    by_eye = Supervision.LINE_OF_SIGHT
    assert permitted(LIMITS, by_eye) == (0.15, 0.15, 0.4)
    assert permitted(replace(LIMITS, max_vy_mps=0.0), by_eye) == (0.15, 0.0, 0.4)


def test_a_velocity_is_the_share_of_each() -> None:
    assert Speeds(0.5, 0.25, 2.0).velocity(Steering(0.5, -1.0, 0.25)) == (0.25, -0.25, 0.5)
