"""A double of the bridge: the real schema on a real Unix socket, without a hub.

    python -m tests.support.bridge_double SOCKET

It refuses what the schema says it refuses. To the gateway each run is another process.
"""

import asyncio
import sys
import uuid
from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager, AbstractContextManager
from functools import partial
from pathlib import Path
from subprocess import Popen
from typing import Any, Final

from common.errors import NotFoundError, PreconditionError, TooMuchError
from common.reasons import Reason
from omniseer.bridge.v1 import bridge_service_pb2 as pb
from omniseer.bridge.v1.bridge_service_pb2_grpc import (
    BridgeServiceServicer,
    add_BridgeServiceServicer_to_server,
)
from omniseer.gateway.v1 import cloud_pb2, recording_pb2
from tests.support.module_program import module_program
from tests.support.serving import serving_on

_REPORT_EVERY_S: Final = 0.5


class BridgeDouble(BridgeServiceServicer):
    """A bridge in this process.

    Attributes:
        report: what it reports; `changed` sends it at once.
        calls: of operators and the gateway: method, recording, metadata.
        answers: to the hub's requests, in order.
        refusal: raised by every call but WatchState, where it is set.
        forgets: whether an answered request goes on being reported, and answered anew.
        flood: sends reports as fast as they are read.
    """

    def __init__(self) -> None:
        self.calls: list[tuple[str, str, dict[str, Any]]] = []
        self.answers: list[pb.AnswerRequestRequest] = []
        self.refusal: Exception | None = None
        self.forgets = self.flood = False
        self.sent = 0
        self._changed = asyncio.Event()
        self.report = pb.WatchStateResponse(instance_id=uuid.uuid4().hex)
        status = self.report.status
        status.state, status.robot, status.fleet = cloud_pb2.CLOUD_STATE_CONNECTED, "lab-1", "lab"
        status.outbox_max_bytes = 64 * 1024 * 1024

    # What tests do

    def changed(self) -> None:
        """Sends the report."""
        self._changed.set()

    def becomes(self, state: cloud_pb2.CloudState.ValueType, why: str = "") -> None:
        """Changes the state of the connection to the hub."""
        self.report.status.state, self.report.status.last_error = state, why
        self.changed()

    def copies(self, recording_id: str) -> recording_pb2.RecordingCopy:
        """The copy of a recording, to be changed; `changed` sends it."""
        for each in self.report.copies:
            if each.recording_id == recording_id:
                return each.copy
        return self.report.copies.add(recording_id=recording_id, state_age_ms=0).copy

    def request(self, request_id: str, remaining_ms: int = 60_000, **more: Any) -> pb.HubRequest:
        """Passes a request of the hub on; `more` has its action."""
        made = self.report.requests.add(
            request_id=request_id, issued_by="anna", remaining_ms=remaining_ms, **more
        )
        self.changed()
        return made

    # BridgeService

    async def WatchState(self, _request: Any, _context: Any) -> AsyncIterator[Any]:  # noqa: N802  # grpc's name
        while True:
            self._changed.clear()
            self.sent += 1
            yield self.report
            if self.flood:
                continue
            try:
                async with asyncio.timeout(_REPORT_EVERY_S):
                    await self._changed.wait()
            except TimeoutError:
                pass  # time for a sign of life

    async def UploadRecording(self, request: Any, context: Any) -> Any:  # noqa: N802
        self._begin("upload", request, context)
        copy = self.copies(request.recording_id)
        if copy.state in (
            recording_pb2.RECORDING_COPY_STATE_UNSPECIFIED,
            recording_pb2.RECORDING_COPY_STATE_FAILED,
        ):
            copy.state, copy.reason = recording_pb2.RECORDING_COPY_STATE_QUEUED, ""
        self.report.status.uploads_waiting = len(self.report.copies)
        self.changed()
        return pb.UploadRecordingResponse(copy=copy)

    async def CancelUpload(self, request: Any, context: Any) -> Any:  # noqa: N802
        self._begin("cancel", request, context)
        copy = self.copies(request.recording_id)
        stood = recording_pb2.RecordingCopy()
        stood.CopyFrom(copy)
        if copy.state == recording_pb2.RECORDING_COPY_STATE_UNSPECIFIED:
            raise NotFoundError("it is not in the queue", Reason.UPLOAD_NOT_QUEUED)
        if copy.state != recording_pb2.RECORDING_COPY_STATE_VERIFIED:
            copy.Clear()
        self.changed()
        return pb.CancelUploadResponse(copy=stood)

    async def AnswerRequest(self, request: Any, _context: Any) -> Any:  # noqa: N802
        if self.refusal:
            raise self.refusal
        self.answers.append(request)
        if not self.forgets:
            kept = [each for each in self.report.requests if each.request_id != request.request_id]
            del self.report.requests[:]
            self.report.requests.extend(kept)
        self.changed()
        return pb.AnswerRequestResponse()

    def _begin(self, method: str, request: Any, context: Any) -> None:
        self.calls.append((method, request.recording_id, dict(context.invocation_metadata())))
        if self.refusal:
            raise self.refusal


NOT_THERE: Final = NotFoundError("there is no such recording", Reason.RECORDING_NOT_FOUND)
RUNS: Final = PreconditionError("it has not ended", Reason.RECORDING_RUNS)
FULL: Final = TooMuchError("1000 recordings wait", Reason.TOO_MANY_UPLOADS)


def serving_bridge(socket: Path, double: BridgeServiceServicer) -> AbstractAsyncContextManager[None]:
    """Serves the double while the block lasts."""
    return serving_on(socket, partial(add_BridgeServiceServicer_to_server, double))


def bridge_process(socket: Path) -> AbstractContextManager[Popen[str]]:
    """A double in a process of its own, to be frozen and killed; serving when the block begins."""
    return module_program("tests.support.bridge_double", str(socket), says="serving")


async def _main() -> None:
    async with serving_bridge(Path(sys.argv[1]), BridgeDouble()):
        print("serving", flush=True)
        await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(_main())
