"""Driving in the status."""

from gateway.rpc.mapping.teleop import drive_state, teleop_status
from gateway.status.teleop import DrivePhase
from gateway.teleop.lane import DriveFacts
from tests.support.drive_views import stopped_view

NOW_S = 1000.0


def test_a_command_and_a_stop_stamped_after_the_snapshots_instant_have_the_age_0() -> None:
    status = teleop_status(stopped_view(NOW_S), NOW_S - 100)
    assert status.last_command_available
    assert (status.last_command_age_ms, status.last_command_stale, status.stop.age_ms) == (0, False, 0)


def test_a_command_goes_stale_after_the_usual_timeout_of_a_mux() -> None:
    status = teleop_status(stopped_view(NOW_S), NOW_S)
    assert (status.last_command_age_ms, status.last_command_stale) == (507, True)


def test_ages_longer_than_the_schema_can_say_are_the_longest() -> None:
    """The defect: on a robot that was up for 50 days an early echo ended the driver's lane."""
    facts = DriveFacts(
        now_ns=5 * 10**15,
        drive=stopped_view(NOW_S).drive,
        phase=DrivePhase.ARMED,
        inhibits=(),
        newest_sequence=1,
        command_age_ms=7,
        loop_age_ms=5 * 10**9,
        picture_age_ms=5 * 10**9,
    )
    state = drive_state(facts).state
    assert (state.command_age_ms, state.loop_age_ms, state.picture_age_ms) == (7, 2**32 - 1, 2**32 - 1)
