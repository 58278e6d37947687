"""Exports have few places: viewers can't take those of operators and the bridge, nor hold theirs for ever."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import aclosing, asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import grpc
import pytest

from bridge.config import GatewaySettings
from bridge.robot.calls import GatewayCalls
from common import bridge_run
from common.reasons import Reason
from gateway.access.role import Role
from gateway.rpc.responses import export_stream
from omniseer.gateway.v1 import recording_pb2 as pb
from omniseer.gateway.v1.recording_pb2_grpc import RecordingServiceStub
from tests.support.bridge_double import BridgeDouble, serving_bridge
from tests.support.eventually import eventually
from tests.support.guarded_gateway import Login, Robot, guarded_gateway, new_robot
from tests.support.recorder_double import RecorderDouble, serving_recorder
from tests.support.refusals import refused

FILE = "data/000000.mcap"
LARGE = bytes(64 * 1024 * 1024)
"""More than any buffer between the recorder and a caller that does not read."""
FULL = (grpc.StatusCode.RESOURCE_EXHAUSTED, Reason.TOO_MANY_EXPORTS)


@dataclass
class Places:
    """A gateway over doubles of recorder and bridge, and who calls it."""

    robot: Robot
    recorder: RecorderDouble
    bridge: BridgeDouble
    viewers: list[Login]
    operator: Login

    def export(self, login: Login, *more: tuple[str, str], **fields: Any) -> Any:
        """An export of the whole file that has just been requested, over a connection of its own."""
        stub: Any = RecordingServiceStub(self.robot.channel())
        request = pb.ExportRecordingRequest(recording_id="one", file=FILE, **fields)
        return stub.ExportRecording(request, metadata=(*login.metadata(), *more), timeout=30)

    async def exports(self) -> int:
        """How many the recorder has begun, that of `knows_both` included."""
        return len(self.recorder.exports)

    async def opened(self, login: Login, *more: tuple[str, str]) -> Any:
        """An export whose header has come."""
        stream = self.export(login, *more)
        assert (await stream.read()).HasField("header")
        return stream


@asynccontextmanager
async def places(folder: Path) -> AsyncIterator[Places]:
    robot, recorder, bridge = new_robot(folder / "credentials"), RecorderDouble(), BridgeDouble()
    recorder.add({FILE: LARGE}, id="one")
    viewers = [robot.add(Role.VIEWER, name=name)[1] for name in ("ben", "cleo", "bridge")]
    _, operator = robot.add(Role.OPERATOR)
    sockets = {"recording": folder / "recorder.sock", "bridge": folder / "bridge.sock"}
    async with (
        serving_recorder(sockets["recording"], recorder),
        serving_bridge(sockets["bridge"], bridge),
        guarded_gateway(robot, **{name: {"socket": socket} for name, socket in sockets.items()}),
    ):
        made = Places(robot, recorder, bridge, viewers, operator)

        async def knows_both() -> bool:
            try:
                probe = await made.opened(viewers[2], (bridge_run.HEADER, bridge.report.instance_id))
            except grpc.aio.AioRpcError:
                return False
            probe.cancel()
            return True

        await eventually(knows_both, bool, "the gateway has reached the recorder")
        yield made


async def uploaded(robot: Places, login: Login) -> int:
    """What the bridge itself reads for an upload."""
    token, authority = robot.robot.directory.path / "token", robot.robot.directory.path / "ca.pem"
    write_private(token, str(login.token))
    write_private(authority, robot.robot.ca.decode())
    settings = GatewaySettings(
        target=f"127.0.0.1:{robot.robot.port}", ca_certificate_file=authority, token_file=token
    )
    async with aclosing(GatewayCalls(settings, robot.bridge.report.instance_id)) as calls:
        (file,) = (await calls.recording("one")).files
        return sum([len(each) async for each in calls.read_recording("one", file)])


def write_private(path: Path, text: str) -> None:
    path.touch(mode=0o600)
    path.write_text(text, encoding="ascii")


async def to_its_end(stream: Any) -> int:
    size = 0
    while (each := await stream.read()) is not grpc.aio.EOF:
        size += len(each.chunk.data)
    return size


async def test_viewers_leave_a_place_for_operators_and_one_for_the_bridge(tmp_path: Path) -> None:
    async with places(tmp_path) as robot:
        robot.recorder.flowing.clear()
        ben, cleo, other = robot.viewers
        held = [await robot.opened(ben) for _ in range(4)]
        assert await refused(to_its_end(robot.export(ben))) == FULL
        held += [await robot.opened(cleo) for _ in range(2)]
        assert await refused(to_its_end(robot.export(cleo))) == FULL
        forged = robot.export(other, (bridge_run.HEADER, "f" * 32))
        assert await refused(to_its_end(forged)) == FULL
        operators = await robot.opened(robot.operator)
        assert await refused(to_its_end(robot.export(robot.operator))) == FULL
        upload = asyncio.create_task(uploaded(robot, other))
        await eventually(robot.exports, lambda count: count >= 9, "the bridge's export has begun")
        robot.recorder.flowing.set()
        assert await to_its_end(operators) == len(LARGE)
        assert await upload == len(LARGE)
        for each in held:
            each.cancel()


@pytest.mark.timed
async def test_a_caller_that_takes_nothing_loses_the_place_with_a_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(export_stream, "STALLED_S", 1.0)
    async with places(tmp_path) as robot:
        robot.recorder.flowing.clear()
        ben, cleo, other = robot.viewers
        held = [await robot.opened(login) for login in (ben, ben, ben, ben, cleo, cleo)]
        assert await refused(to_its_end(robot.export(other))) == FULL
        robot.recorder.flowing.set()

        async def has_a_place() -> bool:
            try:
                return await to_its_end(robot.export(other)) == len(LARGE)
            except grpc.aio.AioRpcError:
                return False

        await eventually(has_a_place, bool, "a place is free again")
        for each in held:
            assert await refused(to_its_end(each)) == (
                grpc.StatusCode.RESOURCE_EXHAUSTED,
                Reason.EXPORT_STALLED,
            )


async def test_a_limit_below_the_documented_one_is_refused(tmp_path: Path) -> None:
    async with places(tmp_path) as robot:
        slow = robot.export(robot.viewers[0], max_bytes_per_s=65_535)
        assert await refused(to_its_end(slow)) == (
            grpc.StatusCode.INVALID_ARGUMENT,
            Reason.INVALID_REQUEST,
        )
        least = robot.export(robot.viewers[0], max_bytes_per_s=65_536)
        assert (await least.read()).HasField("header")
        least.cancel()
