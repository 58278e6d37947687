"""A ROS sampler that hangs in the middleware: the door stays open, and says what is wrong."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import grpc
import pytest
from grpc_health.v1.health_pb2 import HealthCheckRequest, HealthCheckResponse
from grpc_health.v1.health_pb2_grpc import HealthStub

from common import heartbeat
from gateway.app import running
from gateway.assembly import ThisRobot, build
from gateway.config import GatewaySettings
from gateway.health_reporter import ROS_HUNG_AFTER_S, hung_part
from gateway.links.preview.feedback import PreviewServiceConnector
from gateway.rpc.server import SERVICE
from gateway.status.board import Board
from omniseer.gateway.v1.robot_gateway_pb2 import GetSystemStatusRequest
from omniseer.gateway.v1.robot_gateway_pb2_grpc import RobotGatewayStub
from tests.support.eventually import eventually


class StalledRobot:
    """Its sampler has begun, and has hung for a while."""

    def __init__(self, settings: GatewaySettings, stalled_s: float = 10.0) -> None:
        self.board = Board()
        self._real = ThisRobot(settings)
        self._stalled_s = stalled_s

    @contextmanager
    def feeding(self, board: Board) -> Iterator[None]:
        self.board = board
        board.ros_passed_s = time.monotonic() - self._stalled_s
        yield

    def preview_connector(self) -> PreviewServiceConnector:
        return self._real.preview_connector()


def settings_of(directory: Path) -> GatewaySettings:
    return GatewaySettings.model_validate(
        {"grpc": {"port": 0}, "sources": (), "preview": {"socket": directory / "preview.sock"}}
    )


async def test_a_sampler_that_hangs_is_a_fault_and_not_serving_until_it_goes_on(tmp_path: Path) -> None:
    settings = settings_of(tmp_path)
    robot = StalledRobot(settings)
    async with (
        running(build(settings, robot)) as port,
        grpc.aio.insecure_channel(f"127.0.0.1:{port}") as channel,
    ):
        health: Any = HealthStub(channel)
        gateway: Any = RobotGatewayStub(channel)

        async def serving() -> Any:
            return (await health.Check(HealthCheckRequest(service=SERVICE), timeout=5)).status

        async def is_stalled() -> bool:
            status = await gateway.GetSystemStatus(GetSystemStatusRequest(), timeout=5)
            return "ros.stalled" in {fault.id for fault in status.faults if fault.active}

        async def serving_after_a_pass() -> Any:
            robot.board.ros_passed_s = time.monotonic()
            return await serving()

        await eventually(serving, HealthCheckResponse.NOT_SERVING.__eq__, "NOT_SERVING")
        await eventually(is_stalled, bool, "the fault")
        await eventually(serving_after_a_pass, HealthCheckResponse.SERVING.__eq__, "SERVING")


def test_only_a_sampler_that_hangs_for_long_withholds_the_heartbeats() -> None:
    board = Board()
    assert hung_part(board, 1000.0) == ""  # No sampler, or no pass yet: the first one may take its time.
    board.ros_passed_s = 1000.0
    assert hung_part(board, 1000.0 + ROS_HUNG_AFTER_S) == ""
    assert hung_part(board, 1001.0 + ROS_HUNG_AFTER_S) == "ROS has not been read for 31 s"


async def test_the_gateway_withholds_them_until_the_sampler_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    beats = heartbeat.Heartbeats()
    monkeypatch.setattr(heartbeat, "own", lambda: beats)
    settings = settings_of(tmp_path)
    robot = StalledRobot(settings, stalled_s=ROS_HUNG_AFTER_S + 1)

    async def withheld() -> str:
        return beats.withheld

    async def withheld_after_a_pass() -> str:
        robot.board.ros_passed_s = time.monotonic()
        return beats.withheld

    async with running(build(settings, robot)):
        await eventually(withheld, lambda why: why.startswith("ROS has not been read for 3"), "no heartbeats")
        await eventually(withheld_after_a_pass, "".__eq__, "heartbeats again")
