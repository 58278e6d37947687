"""Silence is no stop: how long a base moves after the last velocity that it has received."""

import math

import pytest

from tests.support.heard import Base, Heard

FAULT_S = 10.0


def base(*received: tuple[float, float]) -> Base:
    """A base that has received these speeds, each at an instant relative to the fault."""
    return Base([Heard(FAULT_S + at_s, 0.0, vx_mps, 0.0, 0.0) for at_s, vx_mps in received])


@pytest.mark.parametrize(
    ("received", "stopped_after_s"),
    [
        ([(-1, 0.1), (1, 0.1), (2, 0.0)], 2.0),
        ([(-1, 0.1), (1, 0.0), (2, 0.1), (3, 0.0), (4, 0.0)], 3.0),
        ([(-1, 0.1), (2, 0.0)], 2.0),
        ([(-1, 0.0), (2, 0.1), (3, 0.0)], 3.0),
        ([(-1, 0.0)], 0.0),
        ([], 0.0),
    ],
)
def test_a_base_stops_with_the_first_zero_that_no_motion_follows(
    received: list[tuple[float, float]], stopped_after_s: float
) -> None:
    assert base(*received).stopped_after_s(FAULT_S) == stopped_after_s


@pytest.mark.parametrize(
    "received",
    [
        [(-1, 0.1)],
        [(-2, 0.0), (-1, 0.1)],
        [(-1, 0.1), (1, 0.1)],
        [(-1, 0.1), (1, 0.0), (2, 0.1)],
    ],
)
def test_without_a_zero_it_never_stops(received: list[tuple[float, float]]) -> None:
    assert base(*received).stopped_after_s(FAULT_S) == math.inf
