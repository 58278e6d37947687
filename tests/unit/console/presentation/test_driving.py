"""How driving reads: each phase, each reason, and what to type."""

import pytest

from console.client.drive_reasons import SENTENCES
from console.client.mapping.methods import GET_SYSTEM_STATUS
from console.client.results import DrivePhase
from console.presentation.severity_style import DRIVE_STYLES, SeverityStyle
from console.presentation.status_row import Row, View
from console.presentation.status_table import table_rows
from omniseer.gateway.v1 import states_pb2 as states
from omniseer.gateway.v1 import system_status_pb2, teleop_pb2
from tests.support.gateway_double import healthy_status


def row(*, compact: bool = False, outdated: bool = False, **teleop: object) -> Row:
    """The row of a robot that is set up for driving."""
    message = healthy_status()
    message.teleop.state, message.teleop.enabled = states.TELEOP_ENABLED, True
    message.teleop.max_linear_mps, message.teleop.max_angular_rad_s = 0.35, 0.8
    message.teleop.MergeFrom(system_status_pb2.TeleopStatus(**teleop))  # type: ignore[arg-type]
    status = GET_SYSTEM_STATUS.decode(message.SerializeToString())
    view = View(status, compact=compact, outdated=outdated)
    return next(each for each in table_rows(view) if each.label.lower() == "teleop")


def test_every_phase_has_a_style() -> None:
    assert set(DRIVE_STYLES) == set(DrivePhase)


@pytest.mark.parametrize(
    ("phase", "holder", "text"),
    [
        (teleop_pb2.DRIVE_PHASE_AVAILABLE, "", "no one drives, at most"),
        (teleop_pb2.DRIVE_PHASE_ARMED, "anna", "anna drives, at most"),
        (teleop_pb2.DRIVE_PHASE_DRIVING, "anna", "anna drives, at most"),
    ],
)
def test_who_drives(phase: teleop_pb2.DrivePhase.ValueType, holder: str, text: str) -> None:
    found = row(phase=phase, holder=holder)
    assert found.mark == teleop_pb2.DrivePhase.Name(phase).removeprefix("DRIVE_PHASE_")
    assert (found.style, found.text.startswith(text)) == (SeverityStyle.GOOD, True)


@pytest.mark.parametrize("inhibit", [number for number in teleop_pb2.DriveInhibit.values() if number])
def test_why_the_robot_does_not_move(inhibit: teleop_pb2.DriveInhibit.ValueType) -> None:
    found = row(phase=teleop_pb2.DRIVE_PHASE_INHIBITED, holder="anna", inhibits=[inhibit])
    assert found.style is SeverityStyle.WARNING
    assert any(sentence in found.text for sentence in SENTENCES.values())
    assert "release, and hold again" in found.text


@pytest.mark.parametrize("compact", [True, False])
def test_a_stop_says_by_whom_why_and_what_to_type(compact: bool) -> None:
    stop = teleop_pb2.StopLatch(stop_id=7, by="ben", reason="a child")
    found = row(compact=compact, phase=teleop_pb2.DRIVE_PHASE_STOPPED, holder="anna", stop=stop)
    assert (found.mark, found.style) == ("STOPPED", SeverityStyle.BAD)
    assert found.text.startswith("by ben: a child, anna drives, type: robotctl reset-stop 7")


def test_a_drive_program_that_is_lost_is_no_disabled_one() -> None:
    lost = row(phase=teleop_pb2.DRIVE_PHASE_DISABLED, inhibits=[teleop_pb2.DRIVE_INHIBIT_DRIVE_LOST])
    assert (lost.mark, lost.style) == ("LOST", SeverityStyle.WARNING)
    assert "drive program does not answer" in lost.text
    assert "robotctl drive --enable" in row(phase=teleop_pb2.DRIVE_PHASE_DISABLED).text


def test_the_robots_own_reasons_stand_without_a_driver_and_hide_no_remedy() -> None:
    inhibits = [teleop_pb2.DRIVE_INHIBIT_ROBOT_STOP]
    available = row(phase=teleop_pb2.DRIVE_PHASE_AVAILABLE, inhibits=inhibits).text
    assert available.startswith("the robot's own stop is active, at most")
    disabled = row(phase=teleop_pb2.DRIVE_PHASE_DISABLED, inhibits=inhibits).text
    assert disabled.startswith("the robot's own stop is active, type: robotctl drive --enable")


def test_what_is_outdated_is_the_last_known() -> None:
    found = row(outdated=True, phase=teleop_pb2.DRIVE_PHASE_DRIVING, holder="anna")
    assert (found.mark, found.text.startswith("last known: DRIVING, anna drives")) == ("STALE", True)
