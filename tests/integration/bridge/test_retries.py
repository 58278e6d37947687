"""What fails is tried again, and counted where it fails."""

import asyncio
from pathlib import Path

from fleet.connection import FleetAddress, connect
from omniseer.bridge.v1.bridge_service_pb2 import Retries
from tests.support.event_server import EventServer
from tests.support.eventually import eventually
from tests.support.nats_servers import NatsServers
from tests.support.running_bridge import BridgeProgram, bridge_program, prepare, received


async def retries(bridge: BridgeProgram) -> Retries:
    return (await asyncio.to_thread(lambda: bridge.state)).retries


async def test_each_failure_is_counted_where_it_is(
    tmp_path: Path, gateway: EventServer, servers: NatsServers
) -> None:
    with bridge_program(tmp_path / "bridge", gateway.port, servers.urls) as bridge:
        await asyncio.to_thread(bridge.start)
        gateway.happen(1)
        # The server runs, and has no streams yet.
        found = await eventually(
            lambda: retries(bridge), lambda now: now.hub and now.state, "the hub takes nothing", 40.0
        )
        assert (found.disk, found.upload) == (0, 0)
        await prepare(servers.urls)
        with bridge.full_disk():
            gateway.happen(1)
            await eventually(lambda: retries(bridge), lambda now: now.disk, "the disk takes nothing", 40.0)
        async with connect(FleetAddress(servers.urls)) as hub:
            await hub.connected(20)
            await eventually(
                lambda: received(hub), lambda found: found.add_up_to("run-1", 2), "all is there", 40.0
            )
        # Its stream of the gateway's events stands.
        before = await retries(bridge)
        await gateway.restart()
        await eventually(
            lambda: retries(bridge), lambda now: now.gateway > before.gateway, "the gateway has gone", 40.0
        )
