"""A robot that asks who calls: an admin takes it from its driver, and a stop needs no place for itself."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import grpc
import pytest

from common.reasons import Reason
from common.refusal import refusal_in
from console.client import AsyncGatewayClient, DriveSession, Refused
from gateway.access.role import Role
from omniseer.gateway.v1.robot_gateway_pb2 import GetSystemStatusRequest, WatchSystemStatusRequest
from omniseer.gateway.v1.robot_gateway_pb2_grpc import RobotGatewayStub
from omniseer.gateway.v1.teleop_pb2 import DRIVE_PHASE_AVAILABLE, ResetStopRequest, StopRobotRequest
from omniseer.gateway.v1.teleop_pb2_grpc import TeleopServiceStub
from tests.support.driven_robot import BY_EYE, driven_base, held, in_motion, is_at_rest, moving
from tests.support.eventually import eventually
from tests.support.guarded_gateway import guarded_gateway, new_robot
from tests.support.guarded_program import guarded_program
from tests.support.heard import Base
from tests.support.lost_worker import RESET_WITHIN_S
from tests.support.running_drive import RunningDrive
from tests.support.undisturbed import no_stall, undisturbed_async

# Timed: on a machine that is busy with other tests, a late command would end the motion.
pytestmark = [pytest.mark.ros, pytest.mark.timed]
SPEED_MPS = 0.1
PATIENCE_S = 20.0


@pytest.fixture(scope="module")
def driven(
    module_ros_domain: int,  # noqa: ARG001  # for its effect
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[tuple[Base, RunningDrive]]:
    with driven_base(tmp_path_factory.mktemp("robot")) as parts:
        yield parts


async def test_an_admin_takes_the_robot_from_a_driver_who_holds(
    driven: tuple[Base, RunningDrive], tmp_path: Path
) -> None:
    """It stands still in between, though the driver goes on holding; no stop is left to be reset."""
    base, drive = driven
    teleop = {"socket": str(drive.socket), "line_of_sight": True}
    with guarded_program(tmp_path, tmp_path, teleop=teleop) as robot:
        (anna, _), (carla, _) = robot.added("anna", Role.OPERATOR), robot.added("carla", Role.ADMIN)

        async def attempt() -> None:
            async with (
                AsyncGatewayClient(robot.target, credentials=anna) as driver,
                AsyncGatewayClient(robot.target, credentials=carla) as admin,
            ):
                await eventually(lambda: is_enabled(admin), bool, "driving is enabled")
                async with driver.drive(BY_EYE) as first:
                    await in_motion(driver, first, base, SPEED_MPS)
                    async with held(first, SPEED_MPS):
                        with moving(base, drive), no_stall():
                            await taken_over(admin, first)
                await eventually(lambda: is_at_rest(base), bool, "the last message is zero")

        async def taken_over(admin: AsyncGatewayClient, first: DriveSession) -> None:
            async with admin.drive(replace(BY_EYE, take_over=True)) as second:
                await eventually(lambda: has_ended(first), bool, "the driver's session has ended")
                assert isinstance(first.error, Refused)
                assert first.error.reason == Reason.LEASE_LOST
                await second.ready(PATIENCE_S)
                await eventually(lambda: is_at_rest(base), bool, "the base stands still, and stays so")
                teleop = (await admin.status()).teleop
                assert (teleop.holder, teleop.stop) == ("carla", None)
                await eventually(is_recorded, bool, "the audit log says what has ended the motion")
                await in_motion(admin, second, base, SPEED_MPS)

        async def is_recorded() -> bool:
            kept = tmp_path / "credentials/audit.jsonl"
            return '"taken over by carla"' in kept.read_text(encoding="utf-8")

        await undisturbed_async(attempt)


async def is_enabled(client: AsyncGatewayClient) -> bool:
    return (await client.status()).teleop.enabled


async def has_ended(session: DriveSession) -> bool:
    return session.error is not None


@pytest.mark.parametrize("limit", ["connections", "connections_per_address", "connections_per_caller"])
async def test_a_stop_is_accepted_on_a_connection_beyond_the_limit(
    driven: tuple[Base, RunningDrive], tmp_path: Path, limit: str
) -> None:
    robot = new_robot(tmp_path)
    _, anna = robot.add(Role.OPERATOR)
    said = {"metadata": anna.metadata(), "timeout": 10}
    teleop = {"socket": driven[1].socket}
    async with guarded_gateway(robot, limits={limit: 1}, teleop=teleop):
        placed, beyond = robot.channel(), robot.channel()
        stub: Any = RobotGatewayStub(placed)
        # A stream: a connection without one would make room.
        statuses = stub.WatchSystemStatus(WatchSystemStatusRequest(), metadata=anna.metadata())

        async def watched() -> Any:
            return (await statuses.read()).status.teleop

        async def is_free() -> bool:
            """Whether it may be driven; resets a stop, when it is known what else commands it."""
            found, operator = await watched(), cast("Any", TeleopServiceStub(placed))
            if found.stop.stop_id:
                try:
                    await operator.ResetStop(ResetStopRequest(stop_id=found.stop.stop_id), **said)
                except grpc.aio.AioRpcError as error:
                    # Not yet, or the drive program has not confirmed it within a second.
                    if error.code() not in {
                        grpc.StatusCode.FAILED_PRECONDITION,
                        grpc.StatusCode.UNAVAILABLE,
                    }:
                        raise
            return bool(found.phase == DRIVE_PHASE_AVAILABLE)

        await eventually(is_free, bool, "it may be driven", RESET_WITHIN_S)
        other: Any = RobotGatewayStub(beyond)
        with pytest.raises(grpc.aio.AioRpcError) as refused:
            await other.GetSystemStatus(GetSystemStatusRequest(), **said)
        assert refusal_in(refused.value.trailing_metadata()).reason == Reason.TOO_MANY_CONNECTIONS
        caller: Any = TeleopServiceStub(beyond)
        stopped = await caller.StopRobot(StopRobotRequest(reason="a child"), **said)
        assert stopped.stop.reason == "a child"
        await eventually(watched, lambda it: it.stop.stop_id == stopped.stop.stop_id, "it is stopped")
        await eventually(is_free, bool, "the next test finds no stop", RESET_WITHIN_S)
