"""A client that went without a word: its connection, its streams and its place are free again soon."""

import asyncio
import time
from pathlib import Path
from typing import Any

import grpc
import pytest

from console.client import AsyncGatewayClient, Event
from console.client.results import EventKind
from omniseer.gateway.v1.robot_gateway_pb2 import WatchSystemStatusRequest
from tests.support.bad_links import Relay
from tests.support.running_gateway import Operator, running_gateway

FREED_WITHIN_S = 10.0


async def next_of(events: Any, kind: EventKind) -> Event:
    async with asyncio.timeout(40):
        async for item in events:
            if isinstance(item, Event) and item.kind is kind:
                return item
    raise AssertionError("the stream ended")


@pytest.mark.timed
@pytest.mark.timeout(90)
async def test_a_half_open_connection_is_freed_within_ten_seconds(tmp_path: Path) -> None:
    """The client's machine is gone: nothing closes the connection, and nothing answers on it."""
    # A client without keepalive of its own: nothing but the gateway's notices.
    options = (("grpc.use_local_subchannel_pool", 1),)
    async with (
        running_gateway(tmp_path / "preview.sock") as operator,
        AsyncGatewayClient(f"127.0.0.1:{operator.port}") as observer,
    ):
        events = observer.events()
        with Relay(operator.port) as relay:
            async with grpc.aio.insecure_channel(f"127.0.0.1:{relay.port}", options=options) as channel:
                call = Operator(channel, relay.port).stub.WatchSystemStatus(WatchSystemStatusRequest())
                await call.read()
                joined = {(await next_of(events, EventKind.CLIENT_JOINED)).client_address for _ in range(2)}
                relay.fall_silent()
                silent_s = time.monotonic()
                left = await next_of(events, EventKind.CLIENT_LEFT)
                took_s = time.monotonic() - silent_s
                call.cancel()
        assert left.client_address in joined
        assert took_s < FREED_WITHIN_S
