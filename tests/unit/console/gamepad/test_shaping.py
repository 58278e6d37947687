"""From a stick's deflection to a share of velocity."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.gamepad.shaping import DEAD_ZONE, is_neutral, shaped

DEFLECTIONS = st.floats(-1.5, 1.5)


@given(DEFLECTIONS)
def test_it_is_odd_bounded_and_zero_in_the_dead_zone(deflection: float) -> None:
    share = shaped(deflection)
    assert -1 <= share <= 1
    assert shaped(-deflection) == -share
    assert (share == 0) == is_neutral(deflection)


@given(DEFLECTIONS, DEFLECTIONS)
def test_more_deflection_is_never_less_speed(one: float, other: float) -> None:
    low, high = sorted((one, other))
    assert shaped(low) <= shaped(high)


def test_the_ends_are_reached_and_the_beginning_is_soft() -> None:
    assert shaped(1.0) == 1.0
    assert shaped(-1.0) == -1.0
    assert shaped(DEAD_ZONE + 0.01) < 0.01
    assert shaped(0.5, dead_zone=0.0, expo=0.0) == 0.5
    assert shaped(0.5, dead_zone=0.0, expo=1.0) == 0.125
    assert shaped(0.5, dead_zone=0.0) == pytest.approx(0.3125)


def test_what_is_no_number_is_no_deflection() -> None:
    assert shaped(math.nan) == 0.0
