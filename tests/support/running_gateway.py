"""A whole gateway in the test's own loop, without ROS unless the settings name sources."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import grpc

from gateway.app import serve
from gateway.config import GatewaySettings
from omniseer.gateway.v1.robot_gateway_pb2 import (
    GetOverlaySnapshotRequest,
    GetSystemStatusRequest,
    SetPreviewModeRequest,
)
from omniseer.gateway.v1.robot_gateway_pb2_grpc import RobotGatewayStub
from tests.support.free import free_tcp_port

UP_WITHIN_S = 10.0


def raw_unary(channel: grpc.aio.Channel, path: str) -> "grpc.aio.UnaryUnaryMultiCallable[bytes, bytes]":
    """Returns a method that takes and gives bytes as they are on the wire."""
    return channel.unary_unary(path)


@dataclass
class Operator:
    """Calls a gateway over a real connection."""

    channel: grpc.aio.Channel
    port: int

    def __post_init__(self) -> None:
        self.stub: Any = RobotGatewayStub(self.channel)

    async def status(self) -> Any:
        return await self.stub.GetSystemStatus(GetSystemStatusRequest(), timeout=5)

    async def overlay(self) -> Any:
        return await self.stub.GetOverlaySnapshot(GetOverlaySnapshotRequest(), timeout=5)

    async def switch(
        self, enabled: bool, profile: Any = None, timeout_s: float | None = 10, camera: str = ""
    ) -> Any:
        request = SetPreviewModeRequest(enabled=enabled, profile=profile, camera=camera)
        return await self.stub.SetPreviewMode(request, timeout=timeout_s)


@asynccontextmanager
async def running_gateway(
    preview_socket: Path, *, port: int | None = None, **settings: Any
) -> AsyncIterator[Operator]:
    """Up when this returns, gone when the block ends; `port` is for settings that name their own `grpc`."""
    port, stop = port or free_tcp_port(), asyncio.Event()
    values = {
        "grpc": {"port": port},
        "sources": (),
        **settings,
        "preview": {"socket": preview_socket, **settings.get("preview", {})},
    }
    gateway = asyncio.create_task(serve(GatewaySettings(**values), stop))
    async with grpc.aio.insecure_channel(f"127.0.0.1:{port}") as channel:
        ready = asyncio.create_task(channel.channel_ready())
        done, _ = await asyncio.wait(
            {gateway, ready}, timeout=UP_WITHIN_S, return_when=asyncio.FIRST_COMPLETED
        )
        if gateway in done:
            ready.cancel()
            gateway.result()
        assert ready in done, "the gateway did not come up"
        try:
            yield Operator(channel, port)
        finally:
            stop.set()
            await asyncio.wait_for(gateway, 5)
