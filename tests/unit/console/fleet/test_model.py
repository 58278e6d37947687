"""The fleet's rows and its summary, from the hub's list and the newest states."""

from typing import Any

from console.fleet.model import FleetSummary, ReportedState, fleet_rows, summary, worst_fault
from console.fleet.values import Enrolment, FleetRow, RobotState
from console.fleet.wire import state_of
from fleet.standing import Standing
from omniseer.gateway.v1.fault_pb2 import FAULT_SEVERITY_ERROR, FAULT_SEVERITY_WARNING
from tests.support.fleet_values import healthy_state

NOW = 2_000_000_000_000


def reported(robot: str, *, age_ms: int = 1000, **fields: Any) -> ReportedState:
    message = healthy_state(robot)
    faults = fields.pop("faults", ())
    for name, value in fields.items():
        setattr(message, name, value)
    for severity in faults:
        message.faults.add(fault_id="a.b", severity=severity, message="it is broken")
    message.fault_count = len(faults)
    return ReportedState(state_of(robot, message.SerializeToString()), NOW - age_ms)


def rows(*enrolled: Enrolment, **states: ReportedState) -> dict[str, FleetRow]:
    found = fleet_rows({each.robot: each for each in enrolled}, states, NOW)
    return {row.robot: row for row in found}


def test_up_since_the_gateways_start() -> None:
    row = rows(Enrolment("a"), a=reported("a"))["a"]
    assert row.standing is Standing.UP
    assert row.since_ms == 7_260_000
    assert row.last_seen_ms == 1000


def test_away_since_the_last_state() -> None:
    row = rows(Enrolment("a"), a=reported("a", age_ms=40_000))["a"]
    assert (row.standing, row.since_ms, row.last_seen_ms) == (Standing.AWAY, 40_000, 40_000)
    assert row.state


def test_the_bridge_without_its_gateway() -> None:
    row = rows(Enrolment("a"), a=reported("a", gateway_reachable=False))["a"]
    assert (row.standing, row.since_ms) == (Standing.NO_GATEWAY, None)


def test_enrolled_and_never_seen_or_revoked() -> None:
    found = rows(
        Enrolment("a", since_unix_ms=NOW - 5000),
        Enrolment("b", revoked=True, since_unix_ms=NOW - 7000),
        Enrolment("c"),
        b=reported("b"),
    )
    assert (found["a"].standing, found["a"].since_ms) == (Standing.NEVER_SEEN, 5000)
    assert (found["b"].standing, found["b"].since_ms) == (Standing.REVOKED, 7000)
    assert (found["c"].standing, found["c"].since_ms, found["c"].last_seen_ms) == (
        Standing.NEVER_SEEN,
        None,
        None,
    )


def test_a_state_of_a_robot_that_is_not_on_the_list() -> None:
    assert rows(a=reported("a"))["a"].standing is Standing.NOT_ENROLLED


def test_what_can_not_be_read_says_why() -> None:
    row = rows(Enrolment("a"), a=ReportedState(state_of("a", b"\xff\xff"), NOW))["a"]
    assert row.standing is Standing.UNREADABLE
    assert row.state is None
    assert "no message" in row.problem


def test_a_state_of_the_future_has_no_negative_age() -> None:
    assert rows(Enrolment("a"), a=reported("a", age_ms=-9000))["a"].last_seen_ms == 0


def test_the_rows_are_by_name() -> None:
    found = fleet_rows({"c": Enrolment("c"), "a": Enrolment("a")}, {"b": reported("b")}, NOW)
    assert [row.robot for row in found] == ["a", "b", "c"]


def test_the_worst_fault_wherever_the_robot_lists_it() -> None:
    content = reported("a", faults=(FAULT_SEVERITY_WARNING, FAULT_SEVERITY_ERROR)).content
    assert isinstance(content, RobotState)
    worst = worst_fault(content)
    assert worst
    assert worst.severity.value == "error"


def test_the_fleet_in_numbers() -> None:
    found = fleet_rows(
        {name: Enrolment(name, revoked=name == "g") for name in "abcdefg"},
        {
            "a": reported("a", faults=(FAULT_SEVERITY_ERROR,), upload_count=2),
            "b": reported("b", faults=(FAULT_SEVERITY_WARNING,), outbox_events=7),
            "c": reported("c", age_ms=60_000, faults=(FAULT_SEVERITY_ERROR,), events_dropped=3),
            "d": reported("d", gateway_reachable=False),
            "e": reported("e"),
            "g": reported("g", upload_count=9),
        },
        NOW,
    )
    assert summary(found) == FleetSummary(
        robots=6,
        up=3,
        silent=2,
        with_errors=1,
        with_warnings=1,
        uploads=2,
        outbox_events=7,
        events_dropped=3,
    )
