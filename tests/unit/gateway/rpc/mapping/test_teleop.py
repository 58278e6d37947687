"""Driving in the status."""

from gateway.rpc.mapping.teleop import teleop_status
from tests.support.drive_views import stopped_view

NOW_S = 1000.0


def test_a_command_and_a_stop_stamped_after_the_snapshots_instant_have_the_age_0() -> None:
    status = teleop_status(stopped_view(NOW_S), NOW_S - 100)
    assert status.last_command_available
    assert (status.last_command_age_ms, status.last_command_stale, status.stop.age_ms) == (0, False, 0)


def test_a_command_goes_stale_after_the_usual_timeout_of_a_mux() -> None:
    status = teleop_status(stopped_view(NOW_S), NOW_S)
    assert (status.last_command_age_ms, status.last_command_stale) == (507, True)
