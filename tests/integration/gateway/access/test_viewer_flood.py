"""A viewer's token that calls as fast as it can: it is held to its share, and an operator does not notice."""

import asyncio
from collections import Counter
from contextlib import AsyncExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import grpc
import pytest

from common.errors import DomainError
from common.reasons import Reason
from common.refusal import refusal_in
from gateway.access.role import Role
from gateway.access.token import new_token
from gateway.rpc.calls.methods import CONTRACT
from gateway.rpc.connections.refusal_delay import RefusalDelay
from gateway.rpc.interceptors.turns import EXAMINED
from omniseer.gateway.v1.robot_gateway_pb2 import (
    GetSystemStatusRequest,
    SetPreviewModeRequest,
    WatchSystemStatusRequest,
)
from omniseer.gateway.v1.robot_gateway_pb2_grpc import RobotGatewayStub
from omniseer.gateway.v1.teleop_pb2 import StopRobotRequest
from omniseer.gateway.v1.teleop_pb2_grpc import TeleopServiceStub
from tests.support.detour import detour
from tests.support.guarded_gateway import Login, guarded_gateway, new_robot

LIMITS = {"requests_per_s": 20, "burst": 20, "connections": 8, "connections_per_address": 4}
LOGINS = 3
AT_ONCE = 20


async def flood(stub: Any, login: Login, ends: asyncio.Event) -> tuple[int, set[str]]:
    """Twenty calls at a time; how many were answered, and why the others were not."""
    answered, reasons = 0, set()

    async def call() -> None:
        nonlocal answered
        try:
            await stub.GetSystemStatus(GetSystemStatusRequest(), metadata=login.metadata(), timeout=10)
            answered += 1
        except grpc.aio.AioRpcError as error:
            reasons.add(refusal_in(error.trailing_metadata()).reason or error.code().name)

    while not ends.is_set():
        await asyncio.gather(*(call() for _ in range(AT_ONCE)))
    return answered, reasons


async def test_a_viewer_that_floods_takes_its_share_and_no_operators(tmp_path: Path) -> None:
    robot = new_robot(tmp_path)
    _, viewer = robot.add(Role.VIEWER, name="ben")
    _, operator = robot.add(Role.OPERATOR)
    async with guarded_gateway(robot, limits=LIMITS) as robot, AsyncExitStack() as stack:
        port = await stack.enter_async_context(detour("127.0.0.2", robot.port))
        ends, elsewhere = asyncio.Event(), replace(robot, port=port)
        # More connections than one address may have.
        floods = [
            asyncio.create_task(flood(RobotGatewayStub(elsewhere.channel()), viewer, ends)) for _ in range(6)
        ]
        began_s = asyncio.get_running_loop().time()
        for _ in range(LOGINS):
            calls: Any = RobotGatewayStub(robot.channel())
            for _ in range(5):
                switch = SetPreviewModeRequest(enabled=False)
                assert await calls.SetPreviewMode(switch, metadata=operator.metadata(), timeout=5)
                await asyncio.sleep(0.1)
        took_s = asyncio.get_running_loop().time() - began_s
        ends.set()
        found = await asyncio.gather(*floods)
    answered = sum(count for count, _ in found)
    reasons = set().union(*(each for _, each in found))
    assert reasons == {Reason.TOO_MANY_REQUESTS, Reason.TOO_MANY_CONNECTIONS}
    share = LIMITS["connections_per_address"] * (LIMITS["burst"] + LIMITS["requests_per_s"] * (took_s + 2))
    assert 0 < answered <= share


async def test_more_connections_get_a_viewer_no_more(tmp_path: Path) -> None:
    robot = new_robot(tmp_path)
    _, viewer = robot.add(Role.VIEWER, name="ben")
    async with guarded_gateway(robot, limits={"caller_requests_per_s": 20}) as robot:
        ends = asyncio.Event()
        began_s = asyncio.get_running_loop().time()
        floods = [
            asyncio.create_task(flood(RobotGatewayStub(robot.channel()), viewer, ends)) for _ in range(8)
        ]
        await asyncio.sleep(2)
        ends.set()
        found = await asyncio.gather(*floods)
        took_s = asyncio.get_running_loop().time() - began_s
    assert set().union(*(each for _, each in found)) == {Reason.TOO_MANY_REQUESTS}
    assert 40 <= sum(count for count, _ in found) <= 20 * (2 + took_s)


async def refused(calling: Any) -> str:
    """Why a call is refused; empty if it is not."""
    try:
        await calling
    except grpc.aio.AioRpcError as error:
        return refusal_in(error.trailing_metadata()).reason or error.code().name
    return ""


async def test_refusals_for_a_viewers_role_take_of_the_same_share(tmp_path: Path) -> None:
    """The defect: a caller paid for none of them, and more connections got it more."""
    robot = new_robot(tmp_path)
    _, viewer = robot.add(Role.VIEWER, name="ben")
    async with guarded_gateway(robot, limits={"caller_requests_per_s": 20}) as robot:
        stubs: list[Any] = [RobotGatewayStub(robot.channel()) for _ in range(8)]
        began_s = asyncio.get_running_loop().time()
        calls = [
            each.SetPreviewMode(SetPreviewModeRequest(), metadata=viewer.metadata(), timeout=60)
            for each in stubs
            for _ in range(40)
        ]
        reasons = Counter(await asyncio.gather(*map(refused, calls)))
        took_s = asyncio.get_running_loop().time() - began_s
    assert reasons.keys() == {Reason.ROLE_TOO_LOW, Reason.TOO_MANY_REQUESTS}
    assert 40 <= reasons[Reason.ROLE_TOO_LOW] <= 20 * (2 + took_s)


async def test_wrong_tokens_beside_a_valid_stream_are_delayed_like_a_strangers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    at_once, refuse = [], RefusalDelay.refuse

    async def counted(self: RefusalDelay, error: DomainError, waited_s: float = 0.0) -> NoReturn:
        at_once.append(self.full)
        await refuse(self, error, waited_s)

    monkeypatch.setattr(RefusalDelay, "refuse", counted)
    # Longer than this test lasts.
    monkeypatch.setattr("gateway.rpc.connections.admission.FORGIVEN_AFTER_S", 600.0)
    robot = new_robot(tmp_path)
    _, viewer = robot.add(Role.VIEWER, name="ben")
    async with guarded_gateway(robot) as robot:
        stub: Any = RobotGatewayStub(robot.channel())
        stream = stub.WatchSystemStatus(WatchSystemStatusRequest(), metadata=viewer.metadata())
        await stream.read()
        wrong = Login(new_token("e" * 12).text()).metadata()

        async def ping_wrongly() -> str:
            return await refused(stub.GetSystemStatus(GetSystemStatusRequest(), metadata=wrong, timeout=60))

        # The delay is full, as if others had filled it; then there is room for two turns of a connection.
        monkeypatch.setattr("gateway.rpc.connections.refusal_delay._MAX_DELAYED", 0)
        assert await ping_wrongly() == Reason.CREDENTIAL_UNKNOWN
        monkeypatch.setattr("gateway.rpc.connections.refusal_delay._MAX_DELAYED", 2 * EXAMINED)
        reasons = await asyncio.gather(*(ping_wrongly() for _ in range(8 * EXAMINED)))
        assert set(reasons) == {Reason.CREDENTIAL_UNKNOWN, Reason.LOCKED_OUT}
        assert at_once == [True] + [False] * 8 * EXAMINED
        assert not stream.done()


async def test_nor_more_streams_or_connections(tmp_path: Path) -> None:
    robot = new_robot(tmp_path)
    _, viewer = robot.add(Role.VIEWER, name="ben")
    _, operator = robot.add(Role.OPERATOR)
    limits = {"caller_streams": 5, "connections_per_caller": 3}
    async with guarded_gateway(robot, limits=limits) as robot:

        async def watch(login: Login) -> str:
            """Opens a stream on a connection of its own; why it is refused."""
            stub: Any = RobotGatewayStub(channel := robot.channel())
            kept.append(channel)
            stream = stub.WatchSystemStatus(WatchSystemStatusRequest(), metadata=login.metadata(), timeout=30)
            kept.append(stream)
            return await refused(stream.read())

        kept: list[Any] = []
        assert [await watch(viewer) for _ in range(4)] == ["", "", "", Reason.TOO_MANY_CONNECTIONS]
        stub: Any = RobotGatewayStub(kept[0])
        more = [
            stub.WatchSystemStatus(WatchSystemStatusRequest(), metadata=viewer.metadata(), timeout=30)
            for _ in range(3)
        ]
        # Which of them comes last, gRPC does not promise.
        assert sorted(await asyncio.gather(*(refused(each.read()) for each in more))) == [
            "",
            "",
            Reason.TOO_MANY_STREAMS,
        ]
        assert await watch(operator) == ""


async def test_requests_that_viewers_withhold_leave_room_for_operators(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The defect: two names, each over a few connections, took all the calls that the gateway serves."""
    monkeypatch.setattr("gateway.rpc.interceptors.room.MAX_OPEN", 40)
    monkeypatch.setattr("gateway.rpc.connections.caller_shares.MAX_OPEN_CALLS", 8)
    robot = new_robot(tmp_path)
    viewers = [robot.add(Role.VIEWER, name=name)[1] for name in ("ben", "carla")]
    _, operator = robot.add(Role.OPERATOR)
    path = f"/{CONTRACT.full_name}/GetSystemStatus"
    async with guarded_gateway(robot) as robot:
        withheld: list[Any] = [
            channel.stream_unary(path)(metadata=login.metadata())
            for login in viewers
            for channel in (robot.channel(), robot.channel())
            for _ in range(10)
        ]
        refusals = [asyncio.create_task(refused(each)) for each in withheld]
        ended: list[str] = []
        for each in asyncio.as_completed(refusals):
            ended.append(await each)
            if len(ended) == 2 * (20 - 8):
                break
        assert set(ended) == {Reason.TOO_MANY_REQUESTS}
        calls: Any = RobotGatewayStub(robot.channel())
        switch = SetPreviewModeRequest(enabled=False)
        assert await refused(calls.SetPreviewMode(switch, metadata=operator.metadata(), timeout=10)) == ""
        for call in withheld:
            call.cancel()
        await asyncio.wait(refusals)


async def test_a_stop_finds_room_when_all_calls_of_the_gateway_are_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A robot that does not drive refuses it with a reason of its own."""
    monkeypatch.setattr("gateway.rpc.interceptors.room.MAX_OPEN", 4)
    robot = new_robot(tmp_path)
    _, viewer = robot.add(Role.VIEWER, name="ben")
    async with guarded_gateway(robot) as robot:
        channel = robot.channel()
        stub: Any = RobotGatewayStub(channel)
        watching = [
            stub.WatchSystemStatus(WatchSystemStatusRequest(), metadata=viewer.metadata()) for _ in range(4)
        ]
        for each in watching:
            await each.read()
        with pytest.raises(grpc.aio.AioRpcError) as refused:
            await stub.GetSystemStatus(GetSystemStatusRequest(), metadata=viewer.metadata(), timeout=10)
        assert refused.value.code() is grpc.StatusCode.RESOURCE_EXHAUSTED
        stop: Any = TeleopServiceStub(channel)
        with pytest.raises(grpc.aio.AioRpcError) as answered:
            await stop.StopRobot(StopRobotRequest(), metadata=viewer.metadata(), timeout=10)
        assert answered.value.code() is grpc.StatusCode.FAILED_PRECONDITION
