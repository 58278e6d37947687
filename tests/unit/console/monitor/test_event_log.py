"""Events as lines, and which of them are new."""

from dataclasses import replace

from console.client import CaughtUp, DeadlineExceeded, Event, EventGap, EventPosition, FaultSeverity, Outage
from console.client.results import ControlAction, ControlResult, EventKind, GapReason
from console.monitor.event_log import CAPACITY, EventLine, EventLog, line_of
from console.presentation.severity_style import SeverityStyle

HERE = EventPosition("run", 7)


def happened(kind: EventKind, severity: FaultSeverity, component: str, message: str) -> Event:
    return Event(
        position=HERE,
        monotonic_ns=0,
        wall_clock_unix_ms=5_000_500,
        severity=severity,
        component=component,
        message=message,
        kind=kind,
    )


def test_a_fault_says_how_bad_it_is_and_who_has_it() -> None:
    raised = happened(EventKind.FAULT_RAISED, FaultSeverity.ERROR, "lidar", "stopped turning")
    assert line_of(raised, 0) == EventLine(5000.5, "error: lidar: stopped turning", SeverityStyle.BAD)


def test_who_joins_and_leaves_is_marked() -> None:
    joined = happened(EventKind.CLIENT_JOINED, FaultSeverity.INFO, "gateway", "anna joined")
    line, other = (line_of(event, 0) for event in (joined, replace(joined, kind=EventKind.MODE)))
    assert line
    assert other
    assert (line.presence, other.presence) == (True, False)


def test_a_component_is_not_named_twice() -> None:
    running = happened(EventKind.PREVIEW, FaultSeverity.INFO, "preview", "preview running, balanced")
    assert line_of(running, 0) == EventLine(5000.5, "preview running, balanced", SeverityStyle.QUIET)


def test_a_cleared_fault_says_so() -> None:
    over = happened(EventKind.FAULT_CLEARED, FaultSeverity.INFO, "lidar", "stopped turning")
    line = line_of(over, 0)
    assert line
    assert line.text == "cleared: lidar: stopped turning"


def test_what_the_message_says_itself_is_not_said_twice() -> None:
    over = happened(
        EventKind.FAULT_CLEARED, FaultSeverity.INFO, "odometry", "cleared: odometry stopped coming"
    )
    line = line_of(over, 0)
    assert line
    assert line.text == "cleared: odometry stopped coming"


def test_who_asked_for_what_and_what_came_of_it() -> None:
    action = ControlAction(
        who="anna",
        address="10.0.0.7:5000",
        method="SetPreviewMode",
        request="enabled: true",
        result=ControlResult.REFUSED,
        answer="not now",
    )
    asked = replace(happened(EventKind.CONTROL, FaultSeverity.INFO, "gateway", "long"), control=action)
    line = line_of(asked, 0)
    assert line
    assert line.text == "anna asked for SetPreviewMode: refused, not now"


def test_missed_events_are_reported() -> None:
    gap = EventGap(reason=GapReason.NO_LONGER_KEPT, missed_count=3, position=HERE)
    line = line_of(gap, 99.0)
    assert line == EventLine(
        99.0, "3 events missed: more came than the gateway keeps", SeverityStyle.WARNING, own=True
    )
    anew = line_of(EventGap(reason=GapReason.NEW_RUN, missed_count=0, position=HERE), 99.0)
    assert anew
    assert anew.text.startswith("The gateway was restarted")


def test_the_rest_is_no_event() -> None:
    assert line_of(CaughtUp(position=HERE), 0) is None
    assert line_of(Outage(DeadlineExceeded("silence"), 1), 0) is None


def lines(first: int, count: int) -> list[EventLine]:
    return [EventLine(0, str(number)) for number in range(first, first + count)]


def test_what_was_not_shown_yet() -> None:
    log = EventLog().with_lines(lines(0, 3))
    assert [line.text for line in log.since(0)] == ["0", "1", "2"]
    assert [line.text for line in log.with_lines(lines(3, 1)).since(3)] == ["3"]
    assert log.since(3) == ()


def test_a_log_is_bounded_and_still_knows_what_is_new() -> None:
    log = EventLog().with_lines(lines(0, CAPACITY)).with_lines(lines(CAPACITY, 5))
    assert len(log.lines) == CAPACITY
    assert [line.text for line in log.since(CAPACITY + 3)] == [str(CAPACITY + 3), str(CAPACITY + 4)]
    assert len(log.since(0)) == CAPACITY
