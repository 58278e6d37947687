"""What of recording is a fault."""

from dataclasses import replace

from gateway.status.fault import Severity
from gateway.status.faults.recording import DISK, LOSING, LOSING_FOR_S, SERVICE, recording_faults
from gateway.status.recording import RecorderState, RecorderView
from tests.support.recorder_views import idle, status, view

NOW_S = 1000.0
GOOD = view(idle(), NOW_S)


def ids(recorder: RecorderView | None, *, settled: bool = True) -> dict[str, Severity]:
    return {each.fault_id: each.severity for each in recording_faults(recorder, NOW_S, settled=settled)}


def test_a_recorder_that_works_and_a_robot_without_one_have_none() -> None:
    assert ids(None) == {}
    assert ids(GOOD) == {}
    assert ids(view(status(), NOW_S)) == {}


def test_one_that_does_not_answer_is_one_after_the_grace() -> None:
    lost = replace(GOOD, error="nothing answers on its socket")
    assert ids(lost, settled=False) == {}
    assert ids(lost) == ids(RecorderView("not connected yet")) == {SERVICE: Severity.WARNING}


def test_the_disk_warns_before_it_is_an_error() -> None:
    assert ids(view(idle(), NOW_S, disk_short=True)) == {DISK: Severity.WARNING}
    broken = view(idle(last_error="no room"), NOW_S, disk_short=True)
    assert broken.report
    report = broken.report.value
    failed = replace(report.status, state=RecorderState.FAULTED)
    faulted = replace(broken, report=replace(broken.report, value=replace(report, status=failed)))
    assert ids(faulted) == {DISK: Severity.ERROR}
    (condition,) = recording_faults(faulted, NOW_S, settled=True)
    assert condition.message == "nothing can be recorded: no room"


def test_a_loss_is_one_for_a_while() -> None:
    assert ids(replace(GOOD, lost_s=NOW_S)) == {LOSING: Severity.WARNING}
    assert ids(replace(GOOD, lost_s=NOW_S - LOSING_FOR_S)) == {}
