"""Recordings: passed on to the recorder, which owns them and answers; their copies, to the bridge."""

from collections.abc import AsyncIterator
from typing import Final, Protocol

from google.protobuf.message import Message

from common import bridge_run
from common.errors import NotAllowedError, PreconditionError
from common.reasons import Reason
from gateway.access.role import Role
from gateway.links.bridge.uploads import Uploads
from gateway.links.recorder.calls import RecorderCalls
from gateway.rpc.calls.call import CallContext
from gateway.rpc.mapping.cloud import recording_copy
from gateway.rpc.responses.export_stream import ExportCaller, ExportStream, Rank
from gateway.status.cloud import RecordingCopy, RecordingCopyState
from omniseer.gateway.v1.recording_pb2 import (
    CancelUploadRequest,
    CancelUploadResponse,
    DeleteRecordingRequest,
    ExportRecordingRequest,
    GetRecordingRequest,
    GetRecordingThumbnailRequest,
    ListRecordingsRequest,
    PinRecordingRequest,
    StartRecordingRequest,
    StopRecordingRequest,
    TriggerSnapshotRequest,
    UploadRecordingRequest,
    UploadRecordingResponse,
)


class Bridge(Protocol):
    """The robot's bridge."""

    @property
    def run_id(self) -> str:
        """ID of its run; empty while it does not answer."""


class RecordingService:
    """Handlers of recordings. Requests come here valid, and responses leave as the recorder made them.

    Args:
        calls: to the recorder; None where the robot is not set up for recording.
        exports: passes the bytes of files on.
        uploads: to the bridge; None where the robot is not set up for a fleet.
        bridge: to know its calls by; None where the robot is not set up for a fleet.
    """

    def __init__(
        self,
        calls: RecorderCalls | None,
        exports: ExportStream,
        uploads: Uploads | None,
        bridge: Bridge | None = None,
    ) -> None:
        self._calls = calls
        self._exports = exports
        self._uploads = uploads
        self._bridge = bridge

    async def start_recording(self, request: StartRecordingRequest, call: CallContext) -> bytes:
        """Returns when the first file is open."""
        return await self._pass_on(request, call)

    async def stop_recording(self, request: StopRecordingRequest, call: CallContext) -> bytes:
        """Returns when the files are final, or after 10 s."""
        return await self._pass_on(request, call)

    async def trigger_snapshot(self, request: TriggerSnapshotRequest, call: CallContext) -> bytes:
        """Returns at once."""
        return await self._pass_on(request, call)

    async def list_recordings(self, request: ListRecordingsRequest, call: CallContext) -> bytes:
        """Returns a page."""
        return await self._pass_on(request, call)

    async def get_recording(self, request: GetRecordingRequest, call: CallContext) -> bytes:
        """Returns one recording."""
        return await self._pass_on(request, call)

    async def get_recording_thumbnail(
        self, request: GetRecordingThumbnailRequest, call: CallContext
    ) -> bytes:
        """Returns a key frame."""
        return await self._pass_on(request, call)

    async def pin_recording(self, request: PinRecordingRequest, call: CallContext) -> bytes:
        """Returns when the pin is on the disk."""
        return await self._pass_on(request, call)

    async def delete_recording(self, request: DeleteRecordingRequest, call: CallContext) -> bytes:
        """Returns when the recording is gone.

        Raises:
            NotAllowedError: force by someone who is no administrator.
        """
        self._configured()
        if request.force and call.principal and not call.principal.role.may(Role.ADMIN):
            raise NotAllowedError(
                f"deleting with force needs the role admin; {call.principal.name} has the role "
                f"{call.principal.role.value}"
            )
        return await self._pass_on(request, call)

    def export_recording(self, request: ExportRecordingRequest, call: CallContext) -> AsyncIterator[bytes]:
        """Yields a header, then the chunks."""
        caller = ExportCaller(_caller(call), self._rank(call), counted_as=call.caller)
        return self._exports.responses(self._configured(), request.SerializeToString(), caller)

    async def upload_recording(
        self, request: UploadRecordingRequest, call: CallContext
    ) -> UploadRecordingResponse:
        """Returns when the recording is in the bridge's queue."""
        queued = await self._fleet().queue(
            request.request_id, request.recording_id, _caller(call), call.remaining_s()
        )
        message = f"{queued.recording_id} {_where(queued.copy)}"
        return UploadRecordingResponse(message=message, copy=recording_copy(queued.copy))

    async def cancel_upload(self, request: CancelUploadRequest, call: CallContext) -> CancelUploadResponse:
        """Returns when the recording is no longer in the bridge's queue."""
        ended = await self._fleet().cancel(
            request.request_id, request.recording_id, _caller(call), call.remaining_s()
        )
        kept = ended.copy.state is RecordingCopyState.VERIFIED
        what = _where(ended.copy) if kept else "is not copied to the fleet's store any more"
        return CancelUploadResponse(message=f"{ended.recording_id} {what}")

    def _rank(self, call: CallContext) -> Rank:
        run_id = self._bridge.run_id if self._bridge else ""
        if bridge_run.is_of(run_id, call.rpc.invocation_metadata() or ()):
            return Rank.BRIDGE
        operates = call.principal is None or call.principal.role.may(Role.OPERATOR)
        return Rank.OPERATOR if operates else Rank.VIEWER

    async def _pass_on(self, request: Message, call: CallContext) -> bytes:
        return await self._configured().call(
            call.method.name, request.SerializeToString(), _caller(call), call.remaining_s()
        )

    def _configured(self) -> RecorderCalls:
        if self._calls is None:
            raise PreconditionError(
                "this robot is not set up for recording: run robot-recorder there, and name its socket as "
                "recording.socket in the gateway's configuration",
                Reason.RECORDING_NOT_CONFIGURED,
            )
        return self._calls

    def _fleet(self) -> Uploads:
        self._configured()
        if self._uploads is None:
            raise PreconditionError(
                "this robot is not set up for a fleet: run robot-bridge there, and name its socket as "
                "bridge.socket in the gateway's configuration",
                Reason.FLEET_NOT_CONFIGURED,
            )
        return self._uploads


_WHERE: Final = {
    RecordingCopyState.UPLOADING: "is being copied to the fleet's store",
    RecordingCopyState.VERIFYING: "is being verified in the fleet's store",
    RecordingCopyState.VERIFIED: "is in the fleet's store already, verified",
}


def _where(copy: RecordingCopy) -> str:
    """Returns where a copy stands, as the end of a sentence."""
    return _WHERE.get(copy.state, "waits to be copied to the fleet's store")


def _caller(call: CallContext) -> str:
    """Returns who calls, for people: by name, or by host where callers are not authenticated."""
    return call.principal.name if call.principal else call.peer.host
