"""What a driver's program knows of the robot's clock, from states that arrive late, or not for a while."""

import math
import random

import pytest

from console.client.robot_clock import KEPT_S, RobotClock

MS = 1_000_000
STATE_EVERY_S = 0.05
SHORTEST_WAY_S = 0.01
BOOTED_S = 3600.0
"""The robot's clock minus the driver's."""


def ns(robot_s: float) -> int:
    return round(robot_s * 1e9)


def test_before_the_first_state_nothing_is_known() -> None:
    clock = RobotClock()
    assert clock.newest_ns == 0
    assert clock.at_ns(5.0) == 0
    assert clock.age_s(5.0) == math.inf


def test_the_clock_goes_on_between_two_states() -> None:
    clock = RobotClock()
    clock.note(7_000 * MS, 100.0)
    assert clock.at_ns(100.3) == pytest.approx(7_300 * MS, abs=10)
    assert clock.age_s(100.3) == pytest.approx(0.3)
    clock.note(7_050 * MS, 100.05)
    assert clock.newest_ns == 7_050 * MS


def test_a_state_that_a_lost_packet_has_held_up_takes_nothing_off_a_command() -> None:
    """The defect that it is for: such a state alone would have had commands expire 240 ms too early."""
    clock = RobotClock()
    clock.note(7_000 * MS, 100.0)
    clock.note(7_050 * MS, 100.29)
    assert clock.newest_ns == 7_050 * MS
    assert clock.age_s(100.29) == 0.0
    assert clock.at_ns(100.29) == pytest.approx(7_290 * MS, abs=10)


def test_a_bound_that_grew_old_counts_no_more() -> None:
    """A robot whose clocks stood still, as a virtual machine's do that its host pauses."""
    clock = RobotClock()
    clock.note(7_000 * MS, 100.0)
    clock.note(7_050 * MS, 102.05)
    assert clock.at_ns(102.05) == pytest.approx(7_050 * MS, abs=10)


@pytest.mark.parametrize("seed", range(20))
def test_it_is_never_ahead_of_the_robot_and_as_close_as_the_shortest_way_of_late(seed: int) -> None:
    chance = random.Random(seed)
    clock = RobotClock()
    arrivals: list[tuple[float, float]] = []
    latest_s = 0.0
    for number in range(600):
        made_s = number * STATE_EVERY_S
        way_s = SHORTEST_WAY_S + chance.choice([0.0, 0.0, 0.03, 0.08, 0.3, 0.7]) * chance.random()
        latest_s = max(latest_s, made_s + way_s)  # In order, as on one connection.
        arrivals.append((latest_s, made_s))
    for index, (at_s, made_s) in enumerate(arrivals):
        clock.note(ns(BOOTED_S + made_s), at_s)
        now_s = at_s + chance.random() * STATE_EVERY_S
        behind_s = (ns(BOOTED_S + now_s) - clock.at_ns(now_s)) / 1e9
        shortest_s = min(at - made for at, made in arrivals[: index + 1] if at >= at_s - KEPT_S)
        assert behind_s == pytest.approx(shortest_s, abs=1e-6)
