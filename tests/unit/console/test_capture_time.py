"""Capture times over the wrap of the PTS."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.capture_time import (
    WRAP_TICKS,
    CaptureClock,
    Unwrapped,
    capture_ns,
    nearest,
    ns_to_ticks,
    ticks_to_ns,
)

HOUR_NS = 3600 * 10**9
WRAP_NS = ticks_to_ns(WRAP_TICKS)
TICK_NS = 11_112
YEARS = 20 * 365 * 24 * HOUR_NS


def test_a_wrap_takes_26_and_a_half_hours() -> None:
    assert pytest.approx(26.51, abs=0.01) == WRAP_NS / HOUR_NS


@given(st.integers(0, YEARS), st.integers(-YEARS, YEARS), st.integers(0, 12 * HOUR_NS))
def test_the_capture_time_comes_back_from_33_bits(captured_ns: int, offset_ns: int, age_ns: int) -> None:
    ticks = ns_to_ticks(captured_ns - offset_ns) % WRAP_TICKS
    found_ns = capture_ns(ticks, offset_ns, captured_ns + age_ns)
    assert abs(found_ns - captured_ns) <= TICK_NS


@given(st.integers(0, YEARS), st.integers(0, 12 * HOUR_NS))
def test_a_clock_that_is_behind_does_no_harm(captured_ns: int, behind_ns: int) -> None:
    ticks = ns_to_ticks(captured_ns) % WRAP_TICKS
    assert abs(capture_ns(ticks, 0, captured_ns - behind_ns) - captured_ns) <= TICK_NS


def test_frames_around_the_wrap_are_33_ms_apart() -> None:
    offset_ns = -HOUR_NS
    wrap_ns = WRAP_NS + offset_ns
    times_ns = [
        capture_ns(ticks % WRAP_TICKS, offset_ns, wrap_ns)
        for ticks in range(WRAP_TICKS - 6000, WRAP_TICKS + 9000, 3000)
    ]
    steps = [later - earlier for earlier, later in pairwise(times_ns)]
    assert all(abs(step - 33_333_333) <= 1 for step in steps)


@given(
    st.integers(0, WRAP_TICKS - 1),
    st.lists(st.integers(-(WRAP_TICKS // 2) + 1, WRAP_TICKS // 2 - 1), max_size=50),
)
def test_the_steps_of_a_stream_survive_its_wraps(first: int, steps: list[int]) -> None:
    """Forwards, backwards and over any number of wraps, by up to half of one at a time."""
    unwrapped, sent = Unwrapped(), first
    before = unwrapped.ticks(sent)
    assert before > 0
    for step in steps:
        sent = (sent + step) % WRAP_TICKS
        now = unwrapped.ticks(sent)
        assert now - before == step
        assert now % WRAP_TICKS == sent
        before = now


def test_a_day_and_more_of_frames_goes_on_over_the_wraps() -> None:
    unwrapped = Unwrapped()
    hours = [unwrapped.ticks(hour * 3600 * 90_000 % WRAP_TICKS) for hour in range(100)]
    assert {later - earlier for earlier, later in pairwise(hours)} == {3600 * 90_000}


@given(st.integers(0, WRAP_TICKS - 1), st.integers(-(10**15), 10**15))
def test_the_nearest_has_the_same_bits(ticks: int, reference: int) -> None:
    found = nearest(ticks, reference)
    assert found % WRAP_TICKS == ticks
    assert abs(found - reference) <= WRAP_TICKS // 2


@given(st.integers(0, 1 << 50))
def test_ticks_survive_nanoseconds(ticks: int) -> None:
    assert ns_to_ticks(ticks_to_ns(ticks)) == ticks


def test_the_clock_of_a_stream() -> None:
    clock = CaptureClock(offset_ns=-HOUR_NS, robot_now_ns=lambda: 5_000_000_000)
    pts_ticks = ns_to_ticks(HOUR_NS + 4_900_000_000)
    assert clock.capture_ns(pts_ticks) == 4_900_000_000
    assert clock.age_s(pts_ticks) == pytest.approx(0.1)


def test_without_the_robots_time_there_is_none() -> None:
    clock = CaptureClock(0, lambda: None)
    assert clock.capture_ns(1) is None
    assert clock.age_s(1) is None
