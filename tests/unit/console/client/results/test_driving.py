"""The velocities that a robot accepts of a driver."""

from dataclasses import replace

import pytest

from console.client import Supervision
from console.client.results import DriveLimits

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


@pytest.mark.parametrize("supervision", [Supervision.PICTURE, Supervision.UNKNOWN])
def test_with_a_picture_it_is_what_the_robot_accepts(supervision: Supervision) -> None:
    assert LIMITS.permitted(supervision) == (0.35, 0.25, 0.8)


def test_by_line_of_sight_it_is_what_that_permits_and_no_more_than_the_robot_accepts() -> None:
    by_eye = Supervision.LINE_OF_SIGHT
    assert LIMITS.permitted(by_eye) == (0.15, 0.15, 0.4)
    assert replace(LIMITS, max_vy_mps=0.0).permitted(by_eye) == (0.15, 0.0, 0.4)
