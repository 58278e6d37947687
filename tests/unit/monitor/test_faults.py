"""Faults with their remedies."""

from console.monitor.faults import FaultLine, fault_lines
from console.tone import Tone
from omniseer.gateway.v1 import fault_pb2, overlay_pb2
from tests.support.snapshots import NOW_S, heard, snapshot


def change(made: overlay_pb2.OverlaySnapshot) -> None:
    made.status.faults.add(
        id="odometry.stale",
        severity=fault_pb2.FAULT_SEVERITY_ERROR,
        component="odometry",
        message="stopped coming",
        remedy="Look at the drive",
        active=True,
        age_ms=3000,
    )
    made.status.faults.add(id="x", component="battery", message="low", active=False, cleared_age_ms=5000)


def test_what_is_wrong_with_what_to_do_then_the_cleared_ones() -> None:
    state = heard(snapshot(change))
    assert fault_lines(state, NOW_S) == [
        FaultLine("error", Tone.BAD, "odometry: stopped coming", "Look at the drive", "for 3.0 s"),
        FaultLine("cleared", Tone.QUIET, "battery: low", "", "5.0 s ago"),
    ]


def test_time_goes_on_while_the_robot_is_silent() -> None:
    assert [line.since for line in fault_lines(heard(snapshot(change)), NOW_S + 10)] == [
        "for 13.0 s",
        "15.0 s ago",
    ]


def test_a_healthy_robot_has_none() -> None:
    assert fault_lines(heard(), NOW_S) == []
