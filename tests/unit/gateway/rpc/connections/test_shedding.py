"""Which share of the strangers' attempts to connect is dropped."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.rpc.connections.shedding import (
    BURST,
    LOWER_AFTER_S,
    LOWER_FACTOR,
    MAX_ONE_IN,
    PER_S,
    RAISE_AFTER_S,
    RAISE_FACTOR,
    Shedding,
)
from tests.support.clock import Clock


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def shedding(clock: Clock) -> Shedding:
    return Shedding(clock)


def arrive(shedding: Shedding, count: int) -> int:
    for _ in range(count):
        shedding.note_stranger()
    shedding.adapt()
    return shedding.one_in


def test_a_burst_and_its_rate_are_all_accepted(shedding: Shedding, clock: Clock) -> None:
    assert arrive(shedding, BURST) == 1
    for _ in range(10):
        clock.now_s += 1
        assert arrive(shedding, int(PER_S)) == 1
    assert not shedding.active


def test_one_more_has_most_attempts_dropped(shedding: Shedding) -> None:
    assert arrive(shedding, BURST + 1) == RAISE_FACTOR
    assert shedding.active


def test_the_share_rises_at_each_look_up_to_a_bound(shedding: Shedding, clock: Clock) -> None:
    seen = []
    arrive(shedding, BURST)
    for _ in range(6):
        clock.now_s += 0.1
        seen.append(arrive(shedding, 100))
    assert seen == [RAISE_FACTOR, RAISE_FACTOR**2, MAX_ONE_IN, MAX_ONE_IN, MAX_ONE_IN, MAX_ONE_IN]


def test_looks_in_quick_succession_raise_it_no_faster(shedding: Shedding, clock: Clock) -> None:
    """Those that come between two of them were on their way before attempts were dropped."""
    arrive(shedding, BURST + 1)
    clock.now_s += RAISE_AFTER_S / 2
    assert arrive(shedding, 100) == RAISE_FACTOR
    clock.now_s += RAISE_AFTER_S
    assert arrive(shedding, 0) == RAISE_FACTOR**2, "they were too many all the same"


def test_it_falls_slowly_until_all_are_accepted_again(shedding: Shedding, clock: Clock) -> None:
    arrive(shedding, BURST + 1)
    took_s = 0.0
    while shedding.active:
        clock.now_s += 0.1
        took_s += 0.1
        shedding.adapt()
    halvings = RAISE_FACTOR.bit_length() - 1
    assert LOWER_FACTOR == 2
    assert took_s == pytest.approx(halvings * LOWER_AFTER_S, abs=0.5)


@given(st.lists(st.tuples(st.floats(0, 5), st.integers(0, 1000)), max_size=50))
def test_it_is_always_a_power_of_two_within_bounds(steps: list[tuple[float, int]]) -> None:
    clock = Clock()
    shedding = Shedding(clock)
    for passed_s, count in steps:
        clock.now_s += passed_s
        one_in = arrive(shedding, count)
        assert 1 <= one_in <= MAX_ONE_IN
        assert one_in & (one_in - 1) == 0
