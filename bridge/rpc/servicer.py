"""BridgeService: receives, maps, calls, maps, replies."""

import asyncio
from collections.abc import AsyncIterator, Callable
from typing import Any, Final

import grpc

from bridge.commands.judgement import Upload
from bridge.commands.pending_requests import Pending, PendingRequests
from bridge.connection.connection_status import Status
from bridge.connection.uploading import Uploading
from bridge.outbox.errors import OutboxError
from common.broadcast import HEARTBEAT_S
from common.errors import InvalidRequestError, TooMuchError
from common.reasons import Reason
from fleet.connection import NotTaken
from omniseer.bridge.v1 import bridge_service_pb2 as pb
from omniseer.bridge.v1 import bridge_service_pb2_grpc as pb_grpc
from omniseer.fleet.v1 import command_pb2

SERVICE: Final = pb.DESCRIPTOR.services_by_name["BridgeService"].full_name

_MS_PER_S: Final = 1000
_LEAST_INTERVAL_S: Final = 0.1
"""Between two states: each takes some ms where the queue is long."""
OUTCOMES: Final = {
    pb.REQUEST_OUTCOME_DONE: command_pb2.COMMAND_OUTCOME_DONE,
    pb.REQUEST_OUTCOME_REFUSED: command_pb2.COMMAND_OUTCOME_REFUSED,
    pb.REQUEST_OUTCOME_FAILED: command_pb2.COMMAND_OUTCOME_FAILED,
}


class BridgeServicer(pb_grpc.BridgeServiceServicer):
    """BridgeService.

    Args:
        run_id: of this run of the bridge.
        status: of the connection.
        uploads: the queue.
        requests: requests of the hub.
        not_taken: counts what the connection to the hub has not taken.
        retries: returns how often what was tried again.
    """

    def __init__(
        self,
        run_id: str,
        status: Status,
        uploads: Uploading,
        requests: PendingRequests,
        *,
        not_taken: NotTaken,
        retries: Callable[[], pb.Retries],
    ) -> None:
        self._run_id = run_id
        self._status = status
        self._uploads = uploads
        self._requests = requests
        self._not_taken = not_taken
        self._retries = retries

    def register(self, server: grpc.aio.Server) -> None:
        """Adds the methods to a server."""
        pb_grpc.add_BridgeServiceServicer_to_server(self, server)

    async def WatchState(  # noqa: N802  # the schema names it
        self, _request: pb.WatchStateRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> AsyncIterator[pb.WatchStateResponse]:
        """Streams the state now, after changes, at least every second; a slow reader skips outdated ones."""
        async for _ in self._status.changes.now_and_on_change(lambda: HEARTBEAT_S - _LEAST_INTERVAL_S):
            yield self._state()
            # A queue of a thousand uploads that is made, or that a gate closes, changes as often.
            await asyncio.sleep(_LEAST_INTERVAL_S)

    async def UploadRecording(  # noqa: N802  # the schema names it
        self, request: pb.UploadRecordingRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> pb.UploadRecordingResponse:
        """Queues a recording."""
        return pb.UploadRecordingResponse(copy=await self._uploads.enqueue(request.recording_id))

    async def CancelUpload(  # noqa: N802  # the schema names it
        self, request: pb.CancelUploadRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> pb.CancelUploadResponse:
        """Takes a recording from the queue."""
        return pb.CancelUploadResponse(copy=await self._uploads.cancel(request.recording_id))

    async def AnswerRequest(  # noqa: N802  # the schema names it
        self, request: pb.AnswerRequestRequest, _context: grpc.aio.ServicerContext[Any, Any]
    ) -> pb.AnswerRequestResponse:
        """Ends a request of the hub; the answer is on the disk when this returns."""
        outcome = OUTCOMES.get(request.outcome)
        if outcome is None:
            raise InvalidRequestError("outcome has to be DONE, REFUSED or FAILED")
        try:
            await self._requests.answer(request.request_id, outcome, request.message, request.recording_id)
        except OutboxError as error:
            raise TooMuchError(f"the answer can't be kept: {error}", Reason.DISK_FULL) from error
        return pb.AnswerRequestResponse()

    def _state(self) -> pb.WatchStateResponse:
        return pb.WatchStateResponse(
            instance_id=self._run_id,
            status=self._status.message(),
            copies=self._uploads.copies(),
            requests=[_request(each, self._requests.remaining_s(each)) for each in self._requests.pending],
            not_taken=pb.NotTaken(
                unreadable=self._not_taken.unreadable,
                dropped=self._not_taken.dropped,
                strays=self._requests.strays,
                denied=self._requests.denied,
            ),
            retries=self._retries(),
        )


def _request(pending: Pending, remaining_s: float) -> pb.HubRequest:
    message = pb.HubRequest(
        request_id=pending.request.command_id,
        issued_by=pending.request.issued_by,
        remaining_ms=int(remaining_s * _MS_PER_S),
    )
    action = pending.request.action
    if isinstance(action, Upload):
        message.upload.recording_id = action.recording_id
    else:
        message.snapshot.CopyFrom(
            pb.SnapshotAction(pre_s=action.pre_s, post_s=action.post_s, label=action.label)
        )
    return message
