"""Carries out what the fleet's hub requests and the configuration allows, as an operator's call would be.

The bridge has no right to change anything: it passes the hub's requests on, and this is the only place that
acts on them. `gateway/links/bridge/requests.py` decides.
"""

import asyncio
import hashlib
import logging
import time
from collections.abc import Callable
from typing import Final, NoReturn

from google.protobuf.message import DecodeError, Message

from common import request_id
from common.backoff import Backoff
from common.errors import DefectError, DomainError, InvalidRequestError, NotFoundError, PreconditionError
from common.reasons import Reason
from gateway.links.bridge.calls import BridgeCalls
from gateway.links.bridge.link import BridgeLink
from gateway.links.bridge.requests import Answer, HubRequestRules, Outcome
from gateway.links.bridge.uploads import Uploads
from gateway.links.recorder.calls import RecorderCalls
from gateway.rpc.interceptors.audit import Audit
from gateway.rpc.interceptors.validation import validate
from gateway.status.cloud import HubAction, HubRequest
from gateway.status.event import ControlResult
from omniseer.gateway.v1.recording_pb2 import (
    TriggerSnapshotRequest,
    TriggerSnapshotResponse,
    UploadRecordingRequest,
)

_log = logging.getLogger(__name__)

_FIRST_PAUSE_S: Final = 0.1
_LONGEST_PAUSE_S: Final = 5.0
_ID_CHARACTERS: Final = 32
_METHODS: Final = {HubAction.UPLOAD: "UploadRecording", HubAction.SNAPSHOT: "TriggerSnapshot"}
"""By the action: the operators' method that does the same."""
_UNKNOWN_METHOD: Final = "unknown"
_RESULTS: Final = {
    Outcome.DONE: ControlResult.ACCEPTED,
    Outcome.REFUSED: ControlResult.REFUSED,
    Outcome.FAILED: ControlResult.FAILED,
}


class HubRequests:
    """Takes the requests that the bridge reports, one after another, and answers each.

    Args:
        link: has the reports.
        calls: to the bridge, for answers.
        uploads: queues recordings.
        recorder: makes snapshots; None where the robot is not set up for recording.
        rules: decide.
        audit: records each request.
        clock: monotonic seconds.

    Attributes:
        answered: requests by the outcome that they had.
    """

    def __init__(
        self,
        *,
        link: BridgeLink,
        calls: BridgeCalls,
        uploads: Uploads,
        recorder: RecorderCalls | None,
        rules: HubRequestRules,
        audit: Audit,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._link = link
        self._calls = calls
        self._uploads = uploads
        self._recorder = recorder
        self._rules = rules
        self._audit = audit
        self._clock = clock
        self._given_s: dict[str, float] = {}
        """When the bridge took the answer of a request that it still reports."""
        self.answered = dict.fromkeys(Outcome, 0)

    async def run(self) -> NoReturn:
        """Takes and answers requests, until cancelled."""
        backoff = Backoff(_FIRST_PAUSE_S, _LONGEST_PAUSE_S)
        while True:
            await self._link.changes.wait_until(lambda: bool(self._open()))
            # A request that is reported although it was answered would else be answered without an end.
            stuck = False
            for request in self._open():
                stuck |= request.request_id in self._given_s
                stuck |= not await self._take(request)
            if not stuck:
                backoff.reset()
            await asyncio.sleep(backoff.next_s())

    def _open(self) -> list[HubRequest]:
        """Returns the reported requests, but those that were answered since they were reported."""
        view = self._link.view
        reported = view.newest
        if reported is None or view.report is None:
            return []
        at_s = view.report.at_s
        ids = {each.request_id for each in reported.requests}
        self._given_s = {each: given_s for each, given_s in self._given_s.items() if each in ids}
        return [each for each in reported.requests if self._given_s.get(each.request_id, -1.0) < at_s]

    async def _take(self, request: HubRequest) -> bool:
        """Carries out and answers a request; returns whether the bridge has the answer."""
        answer = self._rules.known(request.request_id) or await self._act(request)
        try:
            await self._calls.answer(request.request_id, answer)
        except NotFoundError:
            _log.info("the request %s of the hub is gone", request.request_id)
        except DomainError as error:
            _log.info("the answer to %s of the hub waits: %s", request.request_id, error)
            return False
        self._given_s[request.request_id] = self._clock()
        return True

    async def _act(self, request: HubRequest) -> Answer:
        """Refuses a request, or carries it out; either is recorded."""
        now_s = self._clock()
        own_id = _own_id(request)
        message = _message(request, own_id)
        answer = self._rules.refusal(request, now_s)
        if answer is None:
            with request_id.continuing(own_id):
                answer = await self._carry_out(request, message, request.expires_s - now_s)
            self._rules.carried_out(request.request_id, answer)
        self.answered[answer.outcome] += 1
        method = _METHODS[request.action] if request.action else _UNKNOWN_METHOD
        self._audit.record_request_of_hub(
            _who(request),
            method,
            message,
            result=_RESULTS[answer.outcome],
            answer=answer.message,
            own_id=own_id,
        )
        return answer

    async def _carry_out(self, request: HubRequest, message: Message | None, left_s: float) -> Answer:
        try:
            if message is not None:
                validate(message)
            if isinstance(message, UploadRecordingRequest):
                return await self._upload(request, message, left_s)
            if isinstance(message, TriggerSnapshotRequest):
                return await self._snapshot(request, message, left_s)
        except InvalidRequestError as error:
            return Answer(Outcome.REFUSED, str(error))
        except DomainError as error:
            return Answer(Outcome.FAILED, str(error))
        raise DefectError(f"no code for the action {request.action}")

    async def _upload(self, request: HubRequest, message: UploadRecordingRequest, left_s: float) -> Answer:
        queued = await self._uploads.queue(message.request_id, message.recording_id, _who(request), left_s)
        said = f"{queued.recording_id}: {queued.copy.state.value}"
        return Answer(Outcome.DONE, said, queued.recording_id)

    async def _snapshot(self, request: HubRequest, message: TriggerSnapshotRequest, left_s: float) -> Answer:
        if self._recorder is None:
            raise PreconditionError("this robot is not set up for recording", Reason.RECORDING_NOT_CONFIGURED)
        method = _METHODS[HubAction.SNAPSHOT]
        data = await self._recorder.call(method, message.SerializeToString(), _who(request), left_s)
        try:
            response = TriggerSnapshotResponse.FromString(data)
        except DecodeError:
            raise DefectError("the recorder's answer can't be read; see its log") from None
        return Answer(Outcome.DONE, response.message, response.recording.id)


def _who(request: HubRequest) -> str:
    return f"fleet: {request.issued_by}"


def _own_id(request: HubRequest) -> str:
    """Returns a request ID of our own: whatever the hub chooses, it is no operator's."""
    return f"fleet-{hashlib.sha256(request.request_id.encode()).hexdigest()[:_ID_CHARACTERS]}"


def _message(request: HubRequest, own_id: str) -> Message | None:
    """Returns the operator's request for the same action; None for one that is not known."""
    match request.action:
        case HubAction.UPLOAD:
            return UploadRecordingRequest(request_id=own_id, recording_id=request.recording_id)
        case HubAction.SNAPSHOT:
            return TriggerSnapshotRequest(
                request_id=own_id, pre_s=request.pre_s, post_s=request.post_s, label=request.label
            )
        case None:
            return None
