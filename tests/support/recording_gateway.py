"""A gateway over a double of the recorder."""

import uuid
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import grpc
from grpc_health.v1 import health_pb2
from grpc_health.v1.health_pb2_grpc import HealthStub

from gateway.health_reporter import RECORDER_HEALTH
from omniseer.gateway.v1 import recording_pb2 as pb
from omniseer.gateway.v1.recording_pb2_grpc import RecordingServiceStub
from tests.support.eventually import eventually
from tests.support.recorder_double import RecorderDouble, serving_recorder
from tests.support.running_gateway import Operator, running_gateway


@dataclass
class RecordingRobot:
    """A gateway, its recorder, and a caller of both services."""

    operator: Operator
    recorder: RecorderDouble

    @property
    def stub(self) -> Any:
        return RecordingServiceStub(self.operator.channel)

    @property
    def port(self) -> int:
        return self.operator.port

    async def state(self) -> Any:
        return (await self.operator.status()).recording.state

    async def is_serving(self) -> bool:
        request = health_pb2.HealthCheckRequest(service=RECORDER_HEALTH)
        try:
            stub: Any = HealthStub(self.operator.channel)
            answer = await stub.Check(request, timeout=5)
        except grpc.aio.AioRpcError:
            return False
        return bool(answer.status == health_pb2.HealthCheckResponse.SERVING)

    async def start(self, **more: Any) -> pb.Recording:
        request = pb.StartRecordingRequest(request_id=uuid.uuid4().hex, **more)
        answer: pb.StartRecordingResponse = await self.stub.StartRecording(request, timeout=5)
        return answer.recording

    async def exported(self, recording_id: str, file: str, **more: Any) -> list[Any]:
        request = pb.ExportRecordingRequest(recording_id=recording_id, file=file, **more)
        return [each async for each in self.stub.ExportRecording(request, timeout=20)]


async def reaches(robot: RecordingRobot, state: Any) -> None:
    """Waits until the status shows a state of the recorder."""
    await eventually(robot.state, lambda now: now == state, f"recorder in state {state}", 10)


@asynccontextmanager
async def recording_robot(
    folder: Path, recorder: RecorderDouble | None = None, **settings: Any
) -> AsyncIterator[RecordingRobot]:
    """Yields a gateway whose recorder is reached already."""
    recorder = recorder or RecorderDouble()
    socket = folder / "recorder.sock"
    async with (
        serving_recorder(socket, recorder),
        running_gateway(folder / "preview.sock", recording={"socket": socket}, **settings) as operator,
    ):
        robot = RecordingRobot(operator, recorder)
        await reaches(robot, recorder.report.status.state)
        # The observer sets it: what happens from now on becomes an event.
        await eventually(robot.is_serving, bool, "the health service knows of the recorder")
        yield robot
