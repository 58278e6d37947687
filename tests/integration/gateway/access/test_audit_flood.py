"""Floods of refused and repeated control calls: what was done before them stays in files and events."""

import asyncio
import json
from contextlib import AsyncExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import grpc
import pytest

from gateway.access.repeats import BURST
from gateway.access.role import Role
from gateway.status.event_log import CAPACITY
from omniseer.gateway.v1.robot_gateway_pb2 import SetPreviewModeRequest, SubscribeEventsRequest
from omniseer.gateway.v1.robot_gateway_pb2_grpc import RobotGatewayStub
from tests.support.detour import detour
from tests.support.guarded_gateway import NOTHING, Login, Robot, guarded_gateway, new_robot, refuse_at_once

CONNECTIONS = 12
CALLS = 250
"""Of each kind, from each connection: ten at once."""
AT_ONCE = 10
MAX_LINE_BYTES = 1200
"""With sixteen times and both texts at their longest."""


async def flood(stub: Any, login: Login) -> None:
    async def switch_off() -> None:
        try:
            await stub.SetPreviewMode(SetPreviewModeRequest(), metadata=login.metadata(), timeout=30)
        except grpc.aio.AioRpcError as error:
            assert error.code() is grpc.StatusCode.UNAUTHENTICATED  # noqa: PT017

    for _ in range(CALLS // AT_ONCE):
        await asyncio.gather(*(switch_off() for _ in range(AT_ONCE)))


async def kept_actions(stub: Any, login: Login) -> list[Any]:
    events = stub.SubscribeEvents(SubscribeEventsRequest(), metadata=login.metadata(), timeout=30)
    found = []
    async for response in events:
        if response.HasField("caught_up"):
            break
        if response.event.HasField("control_action"):
            found.append(response.event.control_action)
    events.cancel()
    return found


def lines(robot: Robot) -> list[dict[str, Any]]:
    files = [*robot.directory.path.glob("audit*.jsonl*")]
    return [json.loads(line) for file in files for line in file.read_text().splitlines()]


async def test_a_flood_from_many_addresses_leaves_what_was_done_before_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refuse_at_once(monkeypatch)
    # Strangers keep their connections here: so many calls may take longer than that on a busy machine.
    monkeypatch.setattr("gateway.rpc.connections.admission.PENDING_S", 120.0)
    robot = new_robot(tmp_path)
    _, annas = robot.add(Role.OPERATOR)
    _, bens = robot.add(Role.OPERATOR, name="ben")
    audit = {"max_kib": 64, "generations": 1}
    async with guarded_gateway(robot, security={"audit": audit}), AsyncExitStack() as stack:
        calls: Any = RobotGatewayStub(robot.channel())
        await calls.SetPreviewMode(SetPreviewModeRequest(enabled=True), metadata=annas.metadata(), timeout=10)
        ports = [
            await stack.enter_async_context(detour(f"127.0.0.{number + 2}", robot.port))
            for number in range(CONNECTIONS)
        ]
        stubs = [RobotGatewayStub(replace(robot, port=port).channel()) for port in ports]
        await asyncio.gather(*(flood(each, login) for each in stubs for login in (NOTHING, bens)))
        actions = await kept_actions(calls, annas)

    assert actions[0].who == "anna"
    assert len(actions) < CAPACITY / 2
    records = lines(robot)
    assert [each["request"] for each in records if each["who"] == "anna"] == ["enabled: true"]
    # Ben calls from twelve addresses, each of which may be another laptop that has his token.
    counts = {who: sum(each.get("count", 1) for each in records if each["who"] == who) for who in ("", "ben")}
    assert counts == {"": CONNECTIONS * CALLS, "ben": CONNECTIONS * CALLS}
    strangers = {each["address"].rpartition(":")[0] for each in records if not each["who"]}
    assert strangers == {f"127.0.0.{number + 2}" for number in range(CONNECTIONS)}
    written = sum(file.stat().st_size for file in robot.directory.path.glob("audit*.jsonl*"))
    assert written <= 2 * CONNECTIONS * (BURST + 2) * MAX_LINE_BYTES
