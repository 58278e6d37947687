"""Which faults are reported to the recorder, and for how long that is tried."""

import asyncio
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from common.errors import DomainError, PreconditionError, RecorderUnreachableError, TooMuchError
from common.reasons import Reason
from gateway.links.recorder.incidents import EXPIRED_S, Incidents
from gateway.status.fault import Condition, Fault, Severity
from gateway.status.faults.recording import OWN
from tests.support.eventually import eventually

FAULT = Fault(Condition("vision.silent", Severity.ERROR, "vision", "it is silent", "look"), 1.0, 1.0, None, 1)


class Calls:
    """A recorder that can be away."""

    def __init__(self) -> None:
        self.reported: list[str] = []
        self.error: Exception | None = None
        self.tried = asyncio.Event()

    async def report_fault(self, fault: Condition) -> str:
        self.tried.set()
        if self.error:
            raise self.error
        self.reported.append(fault.fault_id)
        return ""


def of(fault_id: str, **more: Any) -> Fault:
    return replace(FAULT, condition=replace(FAULT.condition, fault_id=fault_id, **more))


async def until(condition: Callable[[], bool]) -> None:
    async def ask() -> bool:
        return condition()

    await eventually(ask, bool, "the reports get there")


async def turns() -> None:
    for _ in range(20):
        await asyncio.sleep(0)


async def test_each_fault_is_reported_once_while_it_lasts() -> None:
    calls: Any = Calls()
    incidents = Incidents(calls)
    running = asyncio.create_task(incidents.run())
    warning = of("preview.fallback", severity=Severity.WARNING)
    error = replace(warning, condition=replace(warning.condition, severity=Severity.ERROR))
    own = of("recording.disk", component=OWN)
    for _ in range(3):
        incidents.take([FAULT, warning, own, replace(of("old"), cleared_s=2.0)])
        await turns()
    assert sorted(calls.reported) == ["preview.fallback", "vision.silent"]
    incidents.take([warning])
    incidents.take([FAULT, error])
    incidents.take([FAULT, warning])
    await turns()
    assert sorted(calls.reported[2:]) == ["preview.fallback", "vision.silent"]
    running.cancel()


async def test_a_fault_that_becomes_an_error_while_it_is_reported_is_reported_as_one() -> None:
    calls: Any = Calls()
    incidents = Incidents(calls)
    warning = of("preview.fallback", severity=Severity.WARNING)
    error = replace(warning, condition=replace(warning.condition, severity=Severity.ERROR))
    severities = []

    async def report_fault(fault: Condition) -> str:
        severities.append(fault.severity)
        if fault.severity is Severity.WARNING:
            incidents.take([error])
        return ""

    calls.report_fault = report_fault
    running = asyncio.create_task(incidents.run())
    incidents.take([warning])
    await turns()
    assert severities == [Severity.WARNING, Severity.ERROR]
    running.cancel()


async def is_reported_at_the_second_attempt(calls: Any, incidents: Incidents) -> None:
    """The first one meets the error that `calls` has."""
    incidents.take([FAULT])
    await until(calls.tried.is_set)
    calls.error = None
    calls.tried.clear()
    await until(calls.tried.is_set)
    await turns()
    assert (calls.reported, incidents.expired) == (["vision.silent"], 0)


async def test_a_recorder_that_is_away_gets_it_later_but_not_too_late() -> None:
    calls: Any = Calls()
    calls.error, now = RecorderUnreachableError("gone"), [100.0]
    incidents = Incidents(calls, lambda: now[0])
    running = asyncio.create_task(incidents.run())
    await is_reported_at_the_second_attempt(calls, incidents)
    calls.error = RecorderUnreachableError("gone")
    incidents.take([FAULT, of("odometry.silent")])
    now[0] += EXPIRED_S + 1
    await turns()
    assert (calls.reported, incidents.expired) == (["vision.silent"], 1)
    running.cancel()


@pytest.mark.parametrize(
    "refusal",
    [
        PreconditionError("the ring can't be written at present", Reason.RECORDER_NOT_READY),
        TooMuchError("the disk has no room", Reason.DISK_FULL),
        TooMuchError("16 snapshots are being made", Reason.TOO_MANY_SNAPSHOTS),
    ],
    ids=lambda each: each.reason,
)
async def test_what_the_recorder_can_not_take_at_present_is_reported_again_but_not_too_late(
    refusal: DomainError, caplog: pytest.LogCaptureFixture
) -> None:
    """The defect: the fault was dropped for good, though the ring may be back in a second."""
    calls: Any = Calls()
    calls.error, now = refusal, [100.0]
    incidents = Incidents(calls, lambda: now[0])
    running = asyncio.create_task(incidents.run())
    await is_reported_at_the_second_attempt(calls, incidents)
    assert caplog.messages == [f"no incident of vision.silent yet, which is tried again: {refusal}"]
    calls.error = refusal
    calls.tried.clear()
    incidents.take([FAULT, of("odometry.silent")])
    await until(calls.tried.is_set)
    now[0] += EXPIRED_S + 1
    await until(lambda: incidents.expired == 1)
    assert calls.reported == ["vision.silent"]
    assert caplog.messages[-1] == f"no incident was recorded of odometry.silent within 30 s: {refusal}"
    running.cancel()


async def test_a_fault_that_is_refused_holds_up_no_other() -> None:
    calls: Any = Calls()
    incidents = Incidents(calls)

    async def report_fault(fault: Condition) -> str:
        if fault.fault_id == "vision.silent":
            raise PreconditionError("the ring can't be written at present", Reason.RECORDER_NOT_READY)
        calls.reported.append(fault.fault_id)
        return ""

    calls.report_fault = report_fault
    running = asyncio.create_task(incidents.run())
    incidents.take([FAULT, of("battery.low")])
    await until(lambda: calls.reported == ["battery.low"])
    assert incidents.expired == 0
    running.cancel()


async def test_a_refusal_is_not_repeated() -> None:
    calls: Any = Calls()
    calls.error = PreconditionError("no ring", Reason.NO_RING)
    incidents = Incidents(calls)
    running = asyncio.create_task(incidents.run())
    incidents.take([FAULT])
    await turns()
    calls.error = None
    incidents.take([FAULT])
    await turns()
    assert calls.reported == []
    running.cancel()
