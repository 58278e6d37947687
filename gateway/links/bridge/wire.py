"""Schema and client of the bridge (omniseer.bridge.v1).

The bridge passes on words of the hub, which may be anything: every text is cut and printable, every number in
bounds, every list short, and reports that come faster than REPORT_SPACING_S wait in the bridge.
"""

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import grpc

from gateway.links.bridge.requests import Answer, Outcome
from gateway.links.grpc_client import lost, unix_channel
from gateway.links.watch import LinkLostError
from gateway.links.wire_values import by_number, printable, same_fields
from gateway.status.cloud import (
    BridgeReport,
    CloudState,
    CloudStatus,
    CopyReport,
    HubAction,
    HubRequest,
    NotTaken,
    RecordingCopy,
    RecordingCopyState,
    Retries,
)
from omniseer.bridge.v1 import bridge_service_pb2 as pb
from omniseer.bridge.v1.bridge_service_pb2_grpc import BridgeServiceStub

if TYPE_CHECKING:
    # Exists in the generated stubs alone: the name that a type checker knows the asyncio form by.
    from omniseer.bridge.v1.bridge_service_pb2_grpc import BridgeServiceAsyncStub

Metadata = Sequence[tuple[str, str]]

REPORT_SPACING_S: Final = 0.05
"""Least time between two reports: HTTP/2's flow control holds back a bridge that sends more."""
MOST_COPIES: Final = 64
"""Of a report; further ones are not read. As the schema says; the next one, too."""
MOST_REQUESTS: Final = 4
LONGEST_TEXT: Final = 256
"""Characters of a sentence."""
LONGEST_NAME: Final = 64
"""Characters of an ID, of a robot's and a fleet's name (RFC 1123 2.1: 63), and of who requests something."""
_LONGEST_MS: Final = 10**12
"""30 years: longer ages count as that, so that one can count on without leaving 64 bits."""
_LONGEST_EXPIRY_S: Final = 86_400.0
"""Of a command of the hub (command.proto)."""

_REPORT: Final = pb.WatchStateResponse.DESCRIPTOR.fields_by_name
_STATUS: Final = _REPORT["status"].message_type
_COPY: Final = pb.CopyReport.DESCRIPTOR.fields_by_name["copy"].message_type
STATES: Final = by_number(CloudState, _STATUS, "state", "CLOUD_STATE")
COPY_STATES: Final = by_number(RecordingCopyState, _COPY, "state", "RECORDING_COPY_STATE")
OUTCOMES: Final = by_number(Outcome, pb.AnswerRequestRequest.DESCRIPTOR, "outcome", "REQUEST_OUTCOME")
_ACTIONS: Final = {"upload": HubAction.UPLOAD, "snapshot": HubAction.SNAPSHOT}
"""By the field of HubRequest; a test compares with the schema."""


@dataclass(frozen=True, slots=True)
class BridgeConnector:
    """Connects to the bridge on the Unix socket where it listens, or will."""

    socket: Path

    @asynccontextmanager
    async def connect(self) -> AsyncIterator["BridgeClient"]:
        """Yields a client; connects with its first call."""
        async with unix_channel(self.socket) as channel:
            yield BridgeClient(channel)


class BridgeClient:
    """A Reporter of the bridge, and its other methods. All but `reports` raise what gRPC raises."""

    def __init__(self, channel: grpc.aio.Channel) -> None:
        self._stub: BridgeServiceAsyncStub = BridgeServiceStub(channel)

    async def reports(self) -> AsyncIterator[BridgeReport]:
        """Yields what WatchState reports, REPORT_SPACING_S apart at least."""
        stream = self._stub.WatchState(pb.WatchStateRequest())
        try:
            while isinstance(message := await stream.read(), pb.WatchStateResponse):
                yield report_from(message, asyncio.get_running_loop().time())
                await asyncio.sleep(REPORT_SPACING_S)
        except grpc.aio.AioRpcError as error:
            raise lost(error) from None

    async def upload(self, recording_id: str, timeout_s: float, metadata: Metadata) -> RecordingCopy:
        """Puts a recording into the queue; returns where its copy stands."""
        request = pb.UploadRecordingRequest(recording_id=recording_id)
        answer = await self._stub.UploadRecording(request, timeout=timeout_s, metadata=tuple(metadata))
        return _copy(answer.copy)

    async def cancel(self, recording_id: str, timeout_s: float, metadata: Metadata) -> RecordingCopy:
        """Takes a recording from the queue; returns where its copy stood."""
        request = pb.CancelUploadRequest(recording_id=recording_id)
        answer = await self._stub.CancelUpload(request, timeout=timeout_s, metadata=tuple(metadata))
        return _copy(answer.copy)

    async def answer(self, request_id: str, answer: Answer, timeout_s: float) -> None:
        """Answers a request of the hub."""
        number: Any = next(number for number, each in OUTCOMES.items() if each is answer.outcome)
        request = pb.AnswerRequestRequest(
            request_id=request_id,
            outcome=number,
            message=printable(answer.message, LONGEST_TEXT),
            recording_id=answer.recording_id,
        )
        await self._stub.AnswerRequest(request, timeout=timeout_s)


def report_from(message: pb.WatchStateResponse, now_s: float) -> BridgeReport:
    """Returns the report in a message that has just come.

    Copies in a state, and requests with an ID, that this gateway can't understand are left out.

    Raises:
        LinkLostError: the state is unknown, because the bridge is of another version than the gateway.
    """
    state = STATES.get(message.status.state)
    if state is None or state is CloudState.UNREACHABLE:
        number = message.status.state
        raise LinkLostError(f"it reports the unknown state number {number}; its version does not match")
    copies = {
        each.recording_id: CopyReport(each.recording_id, _copy(each.copy), _since_s(each, now_s))
        for each in message.copies[:MOST_COPIES]
        if is_id(each.recording_id) and each.copy.state in COPY_STATES
    }
    requests = {
        each.request_id: _request(each, now_s)
        for each in message.requests[:MOST_REQUESTS]
        if is_id(each.request_id)
    }
    return BridgeReport(
        printable(message.instance_id, LONGEST_NAME),
        _status(message.status, state),
        tuple(copies.values()),
        tuple(requests.values()),
        same_fields(NotTaken, message.not_taken),
        same_fields(Retries, message.retries),
    )


def is_id(text: str) -> bool:
    """Whether a text can be the ID of a recording, or of a request: printable ASCII, 1 to 64 characters."""
    return 0 < len(text) <= LONGEST_NAME and text.isascii() and text.isprintable()


def _status(message: Any, state: CloudState) -> CloudStatus:
    sent_ms = message.last_sent_age_ms if message.HasField("last_sent_age_ms") else None
    return same_fields(
        CloudStatus,
        message,
        state=state,
        robot=printable(message.robot, LONGEST_NAME),
        fleet=printable(message.fleet, LONGEST_NAME),
        state_age_ms=min(message.state_age_ms, _LONGEST_MS),
        last_sent_age_ms=None if sent_ms is None else min(sent_ms, _LONGEST_MS),
        uploading_id=message.uploading_id if is_id(message.uploading_id) else "",
        uploading=_copy(message.uploading) if message.HasField("uploading") else None,
        uploads_paused=printable(message.uploads_paused, LONGEST_TEXT),
        last_error=printable(message.last_error, LONGEST_TEXT),
    )


def _copy(message: Any) -> RecordingCopy:
    return RecordingCopy(
        COPY_STATES.get(message.state, RecordingCopyState.UNSPECIFIED),
        printable(message.reason, LONGEST_TEXT),
        message.bytes_done,
    )


def _since_s(message: pb.CopyReport, now_s: float) -> float | None:
    if not message.HasField("state_age_ms"):
        return None
    return now_s - min(message.state_age_ms, _LONGEST_MS) / 1000


def _request(message: pb.HubRequest, now_s: float) -> HubRequest:
    kind = message.WhichOneof("action")
    snapshot = message.snapshot
    return HubRequest(
        request_id=message.request_id,
        # In the metadata of calls, which are ASCII.
        issued_by=printable(message.issued_by, LONGEST_NAME).encode("ascii", "replace").decode(),
        expires_s=now_s + min(message.remaining_ms / 1000, _LONGEST_EXPIRY_S),
        action=_ACTIONS.get(kind) if kind else None,
        recording_id=message.upload.recording_id[: LONGEST_NAME + 1],
        pre_s=snapshot.pre_s if snapshot.HasField("pre_s") else None,
        post_s=snapshot.post_s if snapshot.HasField("post_s") else None,
        label=printable(snapshot.label, LONGEST_TEXT),
    )
