"""The hub's requests from the report to the answer, with programs that fail in every way."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import Any

import pytest

from common.broadcast import Broadcast
from common.errors import (
    BridgeUnreachableError,
    NotFoundError,
    PreconditionError,
    RecorderUnreachableError,
)
from common.reasons import Reason
from gateway.access.repeats import BURST as RECORDS
from gateway.access.repeats import MAX_KINDS
from gateway.links.bridge.requests import BURST, Answer, HubRequestRules, Outcome
from gateway.links.bridge.uploads import Uploads
from gateway.rpc import hub_requests
from gateway.rpc.hub_requests import HubRequests
from gateway.rpc.interceptors.audit import Audit
from gateway.status.cloud import HubAction, HubRequest, RecordingCopy, RecordingCopyState
from gateway.status.event import ControlAction, ControlResult, Event
from omniseer.gateway.v1.recording_pb2 import TriggerSnapshotRequest, TriggerSnapshotResponse
from tests.support.cloud_views import NEVER, connected, report

NOW_S = 1000.0
UPLOAD = HubRequest("u", "anna", NOW_S + 60, HubAction.UPLOAD, recording_id="a")
SNAPSHOT = HubRequest("s", "anna", NOW_S + 60, HubAction.SNAPSHOT, pre_s=5, label="here")


class Ground:
    """The programs around, all of which may fail, and what was recorded."""

    def __init__(self, *allowed: HubAction, with_recorder: bool = True) -> None:
        self.now_s = NOW_S
        self.view, self.changes = NEVER, Broadcast()
        self.uploaded: list[tuple[str, str, float]] = []
        self.snapshots: list[tuple[TriggerSnapshotRequest, str, float]] = []
        self.answers: list[tuple[str, Answer]] = []
        self.events: list[Event] = []
        self.actions: list[ControlAction] = []
        self.error: Exception | None = None
        self.deaf: Exception | None = None
        this: Any = self
        self.requests = HubRequests(
            link=this,
            calls=this,
            uploads=Uploads(this, None, lambda: self.now_s),
            recorder=this if with_recorder else None,
            rules=HubRequestRules(allowed, NOW_S),
            audit=Audit(this, this, this, lambda: self.now_s),
            clock=lambda: self.now_s,
        )

    def reports(self, *requests: HubRequest) -> None:
        self.now_s += 0.01
        self.view = self.view.reported(report(connected(), requests=requests), self.now_s)
        self.changes.notify_all()

    async def upload(self, recording_id: str, caller: str, remaining_s: float) -> RecordingCopy:
        if self.error:
            raise self.error
        self.uploaded.append((recording_id, caller, remaining_s))
        return RecordingCopy(RecordingCopyState.QUEUED)

    async def call(self, method: str, request: bytes, caller: str, remaining_s: float) -> bytes:
        if self.error:
            raise self.error
        assert method == "TriggerSnapshot"
        self.snapshots.append((TriggerSnapshotRequest.FromString(request), caller, remaining_s))
        response = TriggerSnapshotResponse(message="it is being made")
        response.recording.id = "made"
        return response.SerializeToString()

    async def answer(self, request_id: str, answer: Answer) -> None:
        if self.deaf:
            raise self.deaf
        self.answers.append((request_id, answer))

    def note(self, event: Event) -> None:
        self.events.append(event)

    def record(self, action: ControlAction) -> None:
        self.actions.append(action)


@asynccontextmanager
async def running(*allowed: HubAction, **more: Any) -> AsyncIterator[Ground]:
    ground = Ground(*allowed, **more)
    task = asyncio.create_task(ground.requests.run())
    yield ground
    task.cancel()


@pytest.fixture(autouse=True)
def no_pauses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hub_requests, "_FIRST_PAUSE_S", 0.0)


async def turns(count: int = 50) -> None:
    for _ in range(count):
        await asyncio.sleep(0)


async def test_an_upload_and_a_snapshot_are_carried_out_as_an_operators() -> None:
    async with running(*HubAction) as it:
        it.reports(UPLOAD, SNAPSHOT)
        await turns()
        ((recording_id, caller, left_s),) = it.uploaded
        assert (recording_id, caller) == ("a", "fleet: anna")
        assert left_s < 60
        ((request, caller, _),) = it.snapshots
        assert (request.pre_s, request.label, caller) == (5, "here", "fleet: anna")
        assert not request.HasField("post_s")
        assert dict(it.answers) == {
            "u": Answer(Outcome.DONE, "a: queued", "a"),
            "s": Answer(Outcome.DONE, "it is being made", "made"),
        }
        first, second = it.actions
        assert (first.who, first.address, first.method) == ("fleet: anna", "hub", "UploadRecording")
        assert (second.method, second.result) == ("TriggerSnapshot", ControlResult.ACCEPTED)
        assert 'recording_id: "a"' in first.request
        assert [event.detail for event in it.events] == it.actions
        assert it.requests.answered[Outcome.DONE] == 2


async def test_no_id_of_the_hub_is_an_operators() -> None:
    async with running(*HubAction) as it:
        it.reports(replace(SNAPSHOT, request_id="an-operators-request-id"))
        await turns()
        ((request, _, _),) = it.snapshots
        assert request.request_id.startswith("fleet-")
        assert len(request.request_id) <= 64
        assert it.actions[0].request_id == request.request_id


@pytest.mark.parametrize(
    ("error", "outcome", "result"),
    [
        (None, Outcome.DONE, ControlResult.ACCEPTED),
        (RecorderUnreachableError("gone"), Outcome.FAILED, ControlResult.FAILED),
        (PreconditionError("no ring", Reason.NO_RING), Outcome.FAILED, ControlResult.FAILED),
    ],
)
async def test_a_failure_is_answered_and_recorded(
    error: Exception | None, outcome: Outcome, result: ControlResult
) -> None:
    async with running(*HubAction) as it:
        it.error = error
        it.reports(SNAPSHOT)
        await turns()
        ((_, answer),) = it.answers
        assert answer.outcome is outcome
        assert it.actions[0].result is result


async def test_what_the_rules_of_an_operators_request_forbid_is_refused() -> None:
    async with running(*HubAction) as it:
        it.reports(replace(SNAPSHOT, pre_s=3601), replace(UPLOAD, recording_id=""))
        await turns()
        assert {answer.outcome for _, answer in it.answers} == {Outcome.REFUSED}
        assert not it.snapshots
        assert not it.uploaded


async def test_a_robot_without_a_recorder_makes_no_snapshot() -> None:
    async with running(*HubAction, with_recorder=False) as it:
        it.reports(SNAPSHOT)
        await turns()
        assert it.answers[0][1].outcome is Outcome.FAILED


async def test_an_answer_that_does_not_arrive_is_repeated_and_the_action_is_not() -> None:
    async with running(*HubAction) as it:
        it.deaf = BridgeUnreachableError("gone")
        it.reports(UPLOAD)
        await turns()
        assert not it.answers
        it.deaf = None
        await turns()
        assert [request_id for request_id, _ in it.answers] == ["u"]
        await turns()
        assert len(it.answers) == 1, "until it is reported again"
        it.reports(UPLOAD)
        await turns()
        assert len(it.answers) == 2
        assert len(it.uploaded) == len(it.actions) == 1
        it.deaf = NotFoundError("no such request", Reason.RECORDING_NOT_FOUND)
        it.reports(UPLOAD)
        await turns()
        it.deaf = None
        await turns()
        assert len(it.answers) == 2, "one that is gone needs none"


async def test_a_bridge_that_is_lost_has_no_requests() -> None:
    async with running(*HubAction) as it:
        it.view = it.view.reported(report(connected(), requests=(UPLOAD,)), NOW_S).lost("gone", NOW_S)
        it.changes.notify_all()
        await turns()
        assert not it.uploaded


async def test_ten_thousand_requests_do_what_the_rate_permits_and_are_folded_in_the_log() -> None:
    async with running(HubAction.SNAPSHOT) as it:
        actions = [HubAction.UPLOAD, HubAction.SNAPSHOT, None, HubAction.SNAPSHOT]
        for number in range(0, 10_000, 4):
            it.reports(
                *(
                    HubRequest(str(number + each), f"name {number}", it.now_s + 9, actions[each])
                    for each in range(4)
                )
            )
            it.now_s -= 0.01
            await turns(12)
        assert sum(it.requests.answered.values()) >= 9_990
        assert len(it.snapshots) == BURST
        assert not it.uploaded
        # The tokens of one caller, and the first of each kind, for the two logs.
        assert len(it.actions) <= 2 * (RECORDS + MAX_KINDS + 2)
