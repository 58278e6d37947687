"""A double of the preview service: the real schema on a real Unix socket, without video.

    python -m tests.support.preview_double SOCKET [BEHAVIOUR]

It reaches a desired state at once, unless its behaviour says otherwise. To the gateway every run is another
process of the service: it has an instance id of its own and counts from 0.
"""

import asyncio
import sys
import uuid
from collections.abc import AsyncIterator
from contextlib import AbstractContextManager
from enum import StrEnum
from pathlib import Path
from subprocess import Popen
from typing import Any

import grpc

from common.bind import bind_unix
from common.rpc import new_server
from omniseer.preview.v1 import preview_service_pb2 as pb
from omniseer.preview.v1.preview_service_pb2_grpc import (
    PreviewServiceServicer,
    add_PreviewServiceServicer_to_server,
)
from tests.support.module_program import module_program

SIGN_OF_LIFE_S = 0.5


class Behaviour(StrEnum):
    """Outcome of an enabled desired state."""

    WORKS = "works"
    FAULTS = "faults"
    STAYS_STARTING = "stays-starting"
    REFUSES = "refuses"
    REPORTS_AN_UNKNOWN_STATE = "reports-an-unknown-state"


_REACHES = {
    Behaviour.WORKS: pb.LIFECYCLE_STATE_RUNNING,
    Behaviour.FAULTS: pb.LIFECYCLE_STATE_FAULTED,
    Behaviour.STAYS_STARTING: pb.LIFECYCLE_STATE_STARTING,
}


class PreviewDouble(PreviewServiceServicer):
    """A service in this process.

    Attributes:
        applied: every desired state that it was sent.
        thawed: while it is not set, no call is answered, though connections are accepted.
        key_frames_requested: every request for one.
        picture_ages_ms: every age that it was sent.
        reports_end: has the next stream of reports end after its first message.
    """

    def __init__(self, behaviour: Behaviour = Behaviour.WORKS) -> None:
        self.behaviour = behaviour
        self.applied: list[pb.DesiredState] = []
        self.key_frames_requested: list[pb.RequestKeyFrameRequest] = []
        self.picture_ages_ms: list[int] = []
        self.thawed = asyncio.Event()
        self.thawed.set()
        self.reports_end = False
        self._changed = asyncio.Event()
        self.actual = pb.ActualState(
            instance_id=uuid.uuid4().hex,
            state=pb.LIFECYCLE_STATE_DISABLED,
            listener=pb.Listener(
                port=7100, latency_ms=125, address="127.0.0.1", capture_offset_ns=-3_600_000_000_000
            ),
        )
        if behaviour is Behaviour.REPORTS_AN_UNKNOWN_STATE:
            self.actual.state = 42  # type: ignore[assignment]  # the point of it

    async def ApplyDesiredState(self, request: pb.ApplyDesiredStateRequest, context: Any) -> Any:  # noqa: N802  # grpc's name
        await self.thawed.wait()
        desired = request.desired
        self.applied.append(desired)
        if self.behaviour is Behaviour.REFUSES and desired.enabled:
            await context.abort(grpc.StatusCode.INVALID_ARGUMENT, "the double refuses")
        self.actual.applied_revision = desired.revision
        self.actual.profile = desired.profile
        if desired.enabled:
            self._start()
        else:
            self.actual.state = pb.LIFECYCLE_STATE_DISABLED
            self.actual.ClearField("stream")
        self._changed.set()
        return pb.ApplyDesiredStateResponse(actual=self.actual)

    def _start(self) -> None:
        if self.actual.state != pb.LIFECYCLE_STATE_RUNNING:
            self.actual.counters.starts += 1
        self.actual.state = _REACHES[self.behaviour]
        self.actual.stream.CopyFrom(pb.Stream(width_px=1280, height_px=720, fps=30, target_bitrate_kbps=2500))
        if self.behaviour is Behaviour.FAULTS:
            self.actual.counters.faults += 1
            self.actual.last_error = "no camera found; plug one in"

    async def WatchActualState(self, _request: Any, _context: Any) -> AsyncIterator[Any]:  # noqa: N802
        while True:
            await self.thawed.wait()
            self._changed.clear()
            yield pb.WatchActualStateResponse(actual=self.actual)
            if self.reports_end:
                self.reports_end = False
                return
            try:
                async with asyncio.timeout(SIGN_OF_LIFE_S):
                    await self._changed.wait()
            except TimeoutError:
                pass  # time for a heartbeat

    async def RequestKeyFrame(self, request: pb.RequestKeyFrameRequest, context: Any) -> Any:  # noqa: N802
        await self.thawed.wait()
        if self.actual.state != pb.LIFECYCLE_STATE_RUNNING:
            await context.abort(grpc.StatusCode.FAILED_PRECONDITION, "the double makes no video")
        self.key_frames_requested.append(request)
        return pb.RequestKeyFrameResponse(forced=len(self.key_frames_requested) == 1)

    async def ReportPictureAge(self, request: pb.ReportPictureAgeRequest, _context: Any) -> Any:  # noqa: N802
        await self.thawed.wait()
        self.picture_ages_ms.append(request.age_ms)
        return pb.ReportPictureAgeResponse()

    async def ListEncoders(self, _request: Any, _context: Any) -> Any:  # noqa: N802  # grpc's name
        return pb.ListEncodersResponse()


async def serve_double(socket: Path, double: PreviewDouble) -> grpc.aio.Server:
    """Started; the caller stops it."""
    server = new_server()
    add_PreviewServiceServicer_to_server(double, server)
    bind_unix(server, socket)
    await server.start()
    return server


def double_process(
    socket: Path, behaviour: Behaviour = Behaviour.WORKS
) -> AbstractContextManager[Popen[str]]:
    """A double in a process of its own, to be stopped and killed; serving when the block begins."""
    return module_program("tests.support.preview_double", str(socket), behaviour, says="serving")


async def _main() -> None:
    server = await serve_double(Path(sys.argv[1]), PreviewDouble(Behaviour(sys.argv[2])))
    print("serving", flush=True)
    await server.wait_for_termination()


if __name__ == "__main__":
    asyncio.run(_main())
