"""Rows of the side panel: ages count on between two answers, and without answers nothing is fresh."""

from dataclasses import replace

import pytest

from console.client import Unreachable
from console.monitor.alarm import Alarm
from console.monitor.link import Link, LinkState
from console.monitor.monitor_state import MonitorState
from console.monitor.status_rows import component_rows, fault_items, fault_rows, stream_rows
from console.presentation.own_stream import OwnStream
from console.presentation.severity_style import SeverityStyle
from console.presentation.status_row import Row
from omniseer.gateway.v1 import fault_pb2, overlay_pb2
from tests.support.snapshots import NOW_S, heard, snapshot


def by_label(state: MonitorState, now_s: float = NOW_S) -> dict[str, Row]:
    return {row.label: row for row in component_rows(state, now_s)}


def with_faults(made: overlay_pb2.OverlaySnapshot) -> None:
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


def test_active_faults_with_remedies_then_the_cleared_ones() -> None:
    assert fault_rows(heard(snapshot(with_faults)), NOW_S) == [
        Row("", "error", SeverityStyle.BAD, "odometry: stopped coming", "for 3.0 s", "Look at the drive"),
        Row("", "cleared", SeverityStyle.QUIET, "battery: low", "5.0 s ago"),
    ]


def test_time_goes_on_while_the_robot_is_silent() -> None:
    assert [row.age for row in fault_rows(heard(snapshot(with_faults)), NOW_S + 10)] == [
        "for 13.0 s",
        "15.0 s ago",
    ]


def test_a_healthy_robot_has_no_fault() -> None:
    assert fault_rows(heard(), NOW_S) == []


def test_a_healthy_robot() -> None:
    rows = by_label(heard())
    motion = "0.50\u00a0m/s, turning\u00a0+0.30\u00a0rad/s"
    assert rows["Motion"] == Row("Motion", "fresh", SeverityStyle.GOOD, motion, "")
    assert (rows["Objects"].mark, rows["Objects"].style) == ("no data", SeverityStyle.QUIET)
    assert "Network" not in rows, "a part that the robot never reported has no row"


def test_there_is_no_row_before_the_first_answer() -> None:
    empty = MonitorState(Link(state=LinkState.CONNECTING, since_s=0))
    assert component_rows(empty, NOW_S) == []
    assert fault_rows(empty, NOW_S) == []


def test_stale_is_a_word_and_a_style() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        made.status.vision.stale, made.status.vision.age_ms = True, 3400

    vision = by_label(heard(snapshot(change)))["Vision"]
    assert (vision.mark, vision.style, vision.age) == ("STALE", SeverityStyle.WARNING, "3.4 s")


def test_ages_count_on_between_two_answers() -> None:
    motion = by_label(heard(), NOW_S + 1.99)["Motion"]
    assert (motion.age, motion.mark) == ("2.0 s", "fresh")


@pytest.mark.parametrize("silent_s", [2.1, 60.0])
def test_a_value_that_was_fresh_when_the_robot_fell_silent_is_stale_now(silent_s: float) -> None:
    """A connection that hangs looks connected for a while."""
    motion = by_label(heard(), NOW_S + silent_s)["Motion"]
    assert (motion.mark, motion.style) == ("STALE", SeverityStyle.WARNING)


def test_without_a_connection_nothing_is_fresh() -> None:
    link = Link(state=LinkState.LOST, since_s=NOW_S, error=Unreachable("gone"), attempts=1)
    rows = component_rows(replace(heard(), link=link), NOW_S)
    assert {row.mark for row in rows} == {"STALE", "no data"}


def test_a_gateway_counts_as_up_only_while_it_answers() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        made.status.gateway.boot_id, made.status.gateway.uptime_ms = "a", 90_000
        made.status.gateway.client_count = 2

    state = heard(snapshot(change))
    assert (by_label(state)["Gateway"].text, by_label(state)["Gateway"].age) == ("2 clients", "1 min 30 s")
    assert "Gateway" not in by_label(state, NOW_S + 60)


def test_a_fault_waits_for_its_acknowledgement() -> None:
    state, alarm = heard(snapshot(with_faults)), Alarm()
    assert state.snapshot
    alarm.show(state.snapshot.status.faults)
    assert [item.pending for item in fault_items(state, alarm, NOW_S)] == [True, False]
    alarm.acknowledge()
    assert [item.pending for item in fault_items(state, alarm, NOW_S)] == [False, False]


def test_without_an_active_fault_a_line_says_so_above_the_cleared_ones() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        made.status.faults.add(id="x", component="battery", message="low", active=False, cleared_age_ms=5000)

    items = fault_items(heard(snapshot(change)), Alarm(), NOW_S)
    assert [item.row.mark for item in items] == ["none", "cleared"]


def test_a_silent_robot_is_not_known_to_be_without_a_fault() -> None:
    now, later = (fault_items(heard(), Alarm(), at_s)[0].row for at_s in (NOW_S, NOW_S + 60))
    assert (now.style, later.style) == (SeverityStyle.GOOD, SeverityStyle.QUIET)


def test_a_message_that_begins_with_its_component_is_not_doubled() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        made.status.faults.add(id="x", component="odometry", message="Odometry stopped coming", active=True)

    assert fault_rows(heard(snapshot(change)), NOW_S)[0].text == "Odometry stopped coming"


def test_the_stream_of_this_window_has_a_row_that_warns_of_a_fallback() -> None:
    assert stream_rows(None) == []
    (direct,) = stream_rows(OwnStream("direct, round trip 20 ms, rejoined 2x"))
    assert (direct.style, direct.text) == (SeverityStyle.GOOD, "direct, round trip 20 ms, rejoined 2x")
    (late,) = stream_rows(OwnStream("SRT latency (libsrt is not installed)", is_fallback=True))
    assert (late.mark, late.style) == ("LATE", SeverityStyle.WARNING)
    assert late.text == "SRT latency (libsrt is not installed)"
