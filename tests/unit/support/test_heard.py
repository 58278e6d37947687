"""Silence is no stop: how long a base moves that was told nothing more."""

import math

import pytest

from tests.support.heard import Base, Heard

FAULT_S = 10.0


def base(*told: tuple[float, float]) -> Base:
    """A base that was told a speed at each of these instants, relative to the fault."""
    return Base([Heard(FAULT_S + at_s, 0.0, vx_mps, 0.0, 0.0) for at_s, vx_mps in told])


@pytest.mark.parametrize(
    ("told", "stopped_after_s"),
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
    told: list[tuple[float, float]], stopped_after_s: float
) -> None:
    assert base(*told).stopped_after_s(FAULT_S) == stopped_after_s


@pytest.mark.parametrize(
    "told",
    [
        [(-1, 0.1)],
        [(-2, 0.0), (-1, 0.1)],
        [(-1, 0.1), (1, 0.1)],
        [(-1, 0.1), (1, 0.0), (2, 0.1)],
    ],
)
def test_without_a_zero_it_never_stops(told: list[tuple[float, float]]) -> None:
    assert base(*told).stopped_after_s(FAULT_S) == math.inf
