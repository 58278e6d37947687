"""A gateway over doubles of the bridge and the recorder."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from grpc_health.v1 import health_pb2
from grpc_health.v1.health_pb2_grpc import HealthStub

from gateway.health_reporter import BRIDGE_HEALTH
from omniseer.gateway.v1 import event_pb2
from omniseer.gateway.v1.recording_pb2_grpc import RecordingServiceStub
from omniseer.gateway.v1.robot_gateway_pb2 import SubscribeEventsRequest
from tests.support.bridge_double import BridgeDouble, serving_bridge
from tests.support.eventually import eventually
from tests.support.recorder_double import RecorderDouble, serving_recorder
from tests.support.running_gateway import Operator, running_gateway

BOTH = ("upload", "snapshot")


@dataclass
class FleetRobot:
    """A gateway, its bridge and its recorder, and a caller."""

    operator: Operator
    bridge: BridgeDouble
    recorder: RecorderDouble

    @property
    def stub(self) -> Any:
        return RecordingServiceStub(self.operator.channel)

    @property
    def port(self) -> int:
        return self.operator.port

    async def cloud_state(self) -> Any:
        return (await self.operator.status()).cloud.state

    async def is_serving(self) -> bool:
        """Whether the gateway's observer has seen both programs."""
        request = health_pb2.HealthCheckRequest(service=BRIDGE_HEALTH)
        stub: Any = HealthStub(self.operator.channel)
        answer = await stub.Check(request, timeout=5)
        status = await self.operator.status()
        return bool(answer.status == health_pb2.HealthCheckResponse.SERVING and status.recording.room_bytes)

    async def reaches(self, state: Any) -> None:
        """Waits until the status shows a state of the connection to the hub."""
        await eventually(self.cloud_state, lambda now: now == state, f"cloud in state {state}", 10)

    async def event(self, payload: str) -> event_pb2.Event:
        """The first event with a payload."""
        stream: Any = self.operator.stub.SubscribeEvents(SubscribeEventsRequest(), timeout=15)
        try:
            while True:
                event: event_pb2.Event = (await stream.read()).event
                if event.HasField(payload):  # type: ignore[arg-type]  # a name of the oneof
                    return event
        finally:
            stream.cancel()


@asynccontextmanager
async def fleet_robot(
    folder: Path, *, allowed: tuple[str, ...] = (), bridge: BridgeDouble | None = None, **settings: Any
) -> AsyncIterator[FleetRobot]:
    """Yields a gateway that has reached its bridge and its recorder already."""
    bridge, recorder = bridge or BridgeDouble(), RecorderDouble()
    sockets = {"bridge": folder / "bridge.sock", "recorder": folder / "recorder.sock"}
    async with (
        serving_bridge(sockets["bridge"], bridge),
        serving_recorder(sockets["recorder"], recorder),
        running_gateway(
            folder / "preview.sock",
            recording={"socket": sockets["recorder"]},
            bridge={"socket": sockets["bridge"], "allowed_requests": allowed},
            **settings,
        ) as operator,
    ):
        robot = FleetRobot(operator, bridge, recorder)
        await eventually(robot.is_serving, bool, "the gateway has reached both")
        yield robot
