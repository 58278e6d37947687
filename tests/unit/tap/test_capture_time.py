"""Capture times: the message's stamp where that can be true, and never backwards."""

from itertools import pairwise

import pytest

from common.receive_time import Instant
from tap.capture_time import CaptureTimes

S = 1_000_000_000
SYSTEM_NS = 1_700_000_000 * S
NOW = Instant(1000.0, SYSTEM_NS)
ARRIVED_NS = 1000 * S - 2_000_000


def later(seconds: float) -> Instant:
    return Instant(NOW.monotonic_s + seconds, NOW.system_ns + int(seconds * S))


@pytest.mark.parametrize("age_ns", [1, 30_000_000, 9 * S])
def test_a_stamp_of_the_last_seconds_is_the_capture_time(age_ns: int) -> None:
    times = CaptureTimes()
    assert times.of(SYSTEM_NS - age_ns, ARRIVED_NS, NOW) == pytest.approx(1000 * S - age_ns, abs=1000)
    assert times.replaced == 0


def test_a_stamp_a_little_ahead_is_now() -> None:
    assert CaptureTimes().of(SYSTEM_NS + 50_000_000, ARRIVED_NS, NOW) == 1000 * S


@pytest.mark.parametrize("stamp_ns", [0, -5 * S, 12 * S, SYSTEM_NS - 11 * S, SYSTEM_NS + S, 2**63])
def test_any_other_stamp_is_replaced_by_the_arrival(stamp_ns: int) -> None:
    times = CaptureTimes()
    assert times.of(stamp_ns, ARRIVED_NS, NOW) == ARRIVED_NS
    assert times.replaced == 1


def test_a_stamp_that_is_repeated_does_not_stop_the_time() -> None:
    times = CaptureTimes()
    stamp_ns = SYSTEM_NS - 10_000_000
    times.of(stamp_ns, ARRIVED_NS, NOW)
    assert times.of(stamp_ns, ARRIVED_NS + S, later(1)) == ARRIVED_NS + S


def test_time_never_runs_backwards_and_stamps_count_again_once_they_are_later() -> None:
    times = CaptureTimes()
    found = []
    for index in range(30):
        at_s = index / 30
        age_ns = 0 if index < 5 else 200_000_000
        stamp_ns = SYSTEM_NS + int(at_s * S) - age_ns
        found.append(times.of(stamp_ns, ARRIVED_NS + int(at_s * S), later(at_s)))
    assert all(sooner < after for sooner, after in pairwise(found))
    assert found[-1] == pytest.approx(1000 * S + int(29 / 30 * S) - 200_000_000, abs=1000)


def test_stamps_far_before_what_was_shown_do_not_freeze_the_picture() -> None:
    times = CaptureTimes()
    times.of(SYSTEM_NS, ARRIVED_NS, NOW)
    for index in range(1, 30):
        at_s = index / 30
        arrived_ns = ARRIVED_NS + int(at_s * S)
        assert times.of(SYSTEM_NS + int(at_s * S) - 8 * S, arrived_ns, later(at_s)) >= arrived_ns


def test_of_frames_that_arrive_at_once_each_has_a_time_of_its_own() -> None:
    times = CaptureTimes()
    found = [times.of(0, ARRIVED_NS, NOW) for _ in range(5)]
    assert len(set(found)) == 5
    assert found == sorted(found)
