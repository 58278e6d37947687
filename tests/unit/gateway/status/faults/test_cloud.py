"""What of the fleet is a fault, and that none of them keeps the robot from working."""

from dataclasses import replace

from gateway.config import GatewaySettings
from gateway.status.cloud import CloudState, CloudView, RecordingCopyState
from gateway.status.fault import Fault, Severity
from gateway.status.faults.cloud import (
    DROPPING_FOR_S,
    OFFLINE,
    OUTBOX,
    REFUSED,
    SERVICE,
    UPLOAD,
    cloud_faults,
)
from gateway.status.health import HEALTHY, assess
from tests.support.cloud_views import NEVER, connected, copy_of, report, view

NOW_S = 1000.0
AFTER_S = 600.0


def ids(cloud: CloudView | None, now_s: float = NOW_S, *, settled: bool = True) -> dict[str, Severity]:
    found = cloud_faults(cloud, now_s, offline_after_s=AFTER_S, settled=settled)
    return {each.fault_id: each.severity for each in found}


def test_a_bridge_that_works_and_a_robot_without_one_have_none() -> None:
    assert ids(None) == {}
    assert ids(view(connected(), NOW_S)) == {}


def test_one_that_does_not_answer_is_one_after_the_grace() -> None:
    assert ids(NEVER, settled=False) == {}
    assert ids(NEVER) == {SERVICE: Severity.WARNING}
    assert ids(view(connected(), NOW_S).lost("gone", NOW_S)) == {SERVICE: Severity.WARNING}


def test_one_that_can_not_work_and_one_that_is_refused_are_errors() -> None:
    assert ids(view(connected(state=CloudState.FAULTED), NOW_S)) == {SERVICE: Severity.ERROR}
    refused = view(connected(state=CloudState.REFUSED, last_error="revoked"), NOW_S)
    assert ids(refused) == {REFUSED: Severity.ERROR}
    (condition,) = cloud_faults(refused, NOW_S, offline_after_s=AFTER_S, settled=True)
    assert "(revoked)" in condition.message


def test_the_hub_may_be_away_for_a_while() -> None:
    offline = view(connected(state=CloudState.OFFLINE), NOW_S)
    assert ids(offline) == ids(offline, NOW_S + AFTER_S - 1) == {}
    assert ids(offline, NOW_S + AFTER_S) == {OFFLINE: Severity.WARNING}
    back = offline.reported(report(connected()), NOW_S + AFTER_S)
    assert ids(back, NOW_S + 2 * AFTER_S) == {}


def test_dropped_events_are_one_until_the_outbox_has_room() -> None:
    full = connected(events_dropped=1, outbox_bytes=99, outbox_max_bytes=100)
    known = view(full, NOW_S)
    assert ids(known) == {}, "when they were dropped is not known"
    dropping = known.reported(report(replace(full, events_dropped=2)), NOW_S)
    assert ids(dropping, NOW_S + 10 * DROPPING_FOR_S) == {OUTBOX: Severity.WARNING}
    emptied = dropping.reported(report(replace(full, events_dropped=2, outbox_bytes=10)), NOW_S)
    assert ids(emptied, NOW_S + DROPPING_FOR_S - 1) == {OUTBOX: Severity.WARNING}
    assert ids(emptied, NOW_S + DROPPING_FOR_S) == {}


def test_a_copy_that_fails_is_one() -> None:
    failed = copy_of("a", RecordingCopyState.FAILED, reason="the store is full")
    cloud = view(connected(), NOW_S, copies=(failed, copy_of("b", RecordingCopyState.QUEUED)))
    assert ids(cloud) == {UPLOAD: Severity.WARNING}
    (condition,) = cloud_faults(cloud, NOW_S, offline_after_s=AFTER_S, settled=True)
    assert "the store is full" in condition.message


def test_no_fault_of_the_fleet_degrades_the_robot() -> None:
    ignored = GatewaySettings().faults.ignored_by_health
    for state in (CloudState.FAULTED, CloudState.REFUSED):
        found = cloud_faults(
            view(connected(state=state), NOW_S), NOW_S, offline_after_s=AFTER_S, settled=True
        )
        faults = tuple(Fault(each, 1.0, 1.0, None, 1) for each in found)
        assert faults
        assert assess((), faults, ignored) == HEALTHY
