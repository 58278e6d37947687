"""What of driving is a fault."""

from dataclasses import replace

from gateway.status.fault import Severity
from gateway.status.faults.driving import BASE, STOPPED, UNREACHABLE, driving_faults
from gateway.status.teleop import DrivePhase, DriveView, TeleopView
from tests.support.drive_views import actual, stopped_view

GOOD = TeleopView(DriveView(enabled=True, applied=True, error="", actual=actual()))
LOST = TeleopView(
    DriveView(enabled=True, applied=False, error="it has closed the connection", actual=actual())
)


def ids(view: TeleopView | None, *, settled: bool = True) -> dict[str, Severity]:
    return {each.fault_id: each.severity for each in driving_faults(view, settled=settled)}


def test_a_robot_that_no_one_drives_has_none() -> None:
    assert ids(None) == {}
    assert ids(GOOD) == {}
    assert ids(replace(GOOD, drive=replace(GOOD.drive, actual=actual(phase=DrivePhase.DISABLED)))) == {}


def test_a_drive_program_that_is_gone_is_one_and_worse_while_a_driver_needs_it() -> None:
    assert ids(LOST, settled=False) == {}
    assert ids(LOST) == {UNREACHABLE: Severity.WARNING}
    assert ids(replace(LOST, holder="anna")) == {UNREACHABLE: Severity.ERROR}


def test_a_stop_says_who_and_how_it_is_reset() -> None:
    view = stopped_view(100.0)
    (stopped,) = driving_faults(view, settled=False)
    assert stopped.fault_id == STOPPED
    assert "who stopped: a reason to stop" in stopped.message
    assert "reset-stop 221" in stopped.remedy


def test_what_the_drive_program_says_of_its_base_is_one() -> None:
    view = replace(GOOD, drive=replace(GOOD.drive, actual=actual(problems=("no mux",))))
    assert ids(view) == {BASE: Severity.WARNING}
    assert ids(view, settled=False) == {}
