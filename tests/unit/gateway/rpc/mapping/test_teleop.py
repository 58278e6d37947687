"""Driving in the status, and in what a driver is sent."""

import math
from dataclasses import replace

import pytest

from gateway.rpc.mapping.teleop import drive_state, teleop_status
from gateway.status.teleop import DrivePhase, DriveView
from gateway.teleop.lane import DriveFacts
from tests.support.drive_views import LIMITS, actual, stopped_view

NOW_S = 1000.0


def test_a_command_and_a_stop_stamped_after_the_snapshots_instant_have_the_age_0() -> None:
    status = teleop_status(stopped_view(NOW_S), NOW_S - 100)
    assert status.last_command_available
    assert (status.last_command_age_ms, status.last_command_stale, status.stop.age_ms) == (0, False, 0)


def test_a_command_goes_stale_after_the_usual_timeout_of_a_mux() -> None:
    status = teleop_status(stopped_view(NOW_S), NOW_S)
    assert (status.last_command_age_ms, status.last_command_stale) == (507, True)


def facts(drive: DriveView, **more: int) -> DriveFacts:
    ages = {"command_age_ms": 7, "loop_age_ms": 20, "picture_age_ms": 580} | more
    return DriveFacts(
        now_ns=5 * 10**15, drive=drive, phase=DrivePhase.ARMED, inhibits=(), newest_sequence=1, **ages
    )


def test_ages_longer_than_the_schema_can_say_are_the_longest() -> None:
    """The defect: on a robot that was up for 50 days an early echo ended the driver's lane."""
    longest = facts(stopped_view(NOW_S).drive, loop_age_ms=5 * 10**9, picture_age_ms=5 * 10**9)
    state = drive_state(longest).state
    assert (state.command_age_ms, state.loop_age_ms, state.picture_age_ms) == (7, 2**32 - 1, 2**32 - 1)


@pytest.mark.parametrize(
    ("reported_rad_s", "sent_rad_s"), [(0.5, 0.5), (math.inf, LIMITS.max_wz_rad_s), (None, None)]
)
def test_the_limit_of_turning_is_what_the_drive_program_says_and_the_robots_own_at_the_most(
    reported_rad_s: float | None, sent_rad_s: float | None
) -> None:
    view = DriveView(enabled=True, applied=True, error="", actual=actual(turn_limit_rad_s=reported_rad_s))
    state = drive_state(facts(view)).state
    assert (state.turn_limit_rad_s if state.HasField("turn_limit_rad_s") else None) == sent_rad_s
    unreachable = drive_state(facts(replace(view, error="gone"))).state
    assert not unreachable.HasField("turn_limit_rad_s")
