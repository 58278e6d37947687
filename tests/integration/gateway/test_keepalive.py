"""A client that watches its connection closely is not sent away for it."""

import asyncio
from pathlib import Path

import grpc

from tests.support.running_gateway import Operator, running_gateway

PING_EVERY_MS = 1100
# The third ping too many ends a connection; this is time for five.
QUIET_S = 6.0


async def test_a_quiet_client_may_ping_every_second(tmp_path: Path) -> None:
    options = (
        ("grpc.keepalive_time_ms", PING_EVERY_MS),
        ("grpc.keepalive_permit_without_calls", 1),
        ("grpc.http2.max_pings_without_data", 0),
    )
    async with (
        running_gateway(tmp_path / "preview.sock") as operator,
        grpc.aio.insecure_channel(f"127.0.0.1:{operator.port}", options=options) as channel,
    ):
        await asyncio.wait_for(channel.channel_ready(), 10)
        # A connection without a call is closed after a while for that, however it pings.
        await Operator(channel, operator.port).status()
        left_ready = channel.wait_for_state_change(grpc.ChannelConnectivity.READY)
        done, _ = await asyncio.wait({asyncio.ensure_future(left_ready)}, timeout=QUIET_S)
        assert not done, f"the connection ended: {channel.get_state()}"
