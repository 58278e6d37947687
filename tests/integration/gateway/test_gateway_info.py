"""The gateway about itself, over a real connection."""

import asyncio
import json
import time
from collections.abc import AsyncIterator
from pathlib import Path

import grpc
import pytest

from common.boot import boot_id
from omniseer.gateway.v1.robot_gateway_pb2 import GetGatewayInfoRequest
from tests.support.running_gateway import Operator, running_gateway


@pytest.fixture
async def operator(tmp_path: Path) -> AsyncIterator[Operator]:
    async with running_gateway(tmp_path / "preview.sock", name="lab") as operator:
        yield operator


async def test_calls_are_counted_by_what_became_of_them(operator: Operator) -> None:
    await asyncio.gather(*(operator.status() for _ in range(5)))
    with pytest.raises(grpc.aio.AioRpcError, match="profile 9 does not exist"):
        await operator.switch(enabled=True, profile=9)
    info = await operator.stub.GetGatewayInfo(GetGatewayInfoRequest(), timeout=5)
    counts = {each.method: (each.served, each.refused, each.failed) for each in info.methods}
    assert counts["GetSystemStatus"] == (5, 0, 0)
    assert counts["SetPreviewMode"] == (0, 1, 0)
    assert (info.gateway.requests_served, info.gateway.requests_refused) == (5, 1)
    assert info.gateway.client_count == 1


async def test_it_reports_its_clock_and_what_it_is_configured_to(operator: Operator, tmp_path: Path) -> None:
    before_ms = time.time_ns() // 1_000_000
    info = await operator.stub.GetGatewayInfo(GetGatewayInfoRequest(), timeout=5)
    assert before_ms <= info.wall_clock_unix_ms <= time.time_ns() // 1_000_000
    assert json.loads(info.configuration_json)["name"] == "lab"
    assert str(tmp_path) not in info.configuration_json


async def test_the_same_boot_and_a_growing_uptime(operator: Operator) -> None:
    first = (await operator.status()).gateway
    info = await operator.stub.GetGatewayInfo(GetGatewayInfoRequest(), timeout=5)
    assert first.boot_id == info.gateway.boot_id == boot_id()
    assert info.gateway.uptime_ms >= first.uptime_ms
