"""Events on their way to a real hub: received = issued - announced gaps, none twice, in order.

BRIDGE_KILLS=200 in the environment kills many times.
"""

import asyncio
import os
import random
from pathlib import Path

import pytest

from fleet.connection import Hub
from tests.support.event_server import EventServer
from tests.support.eventually import eventually
from tests.support.nats_servers import NatsServers
from tests.support.running_bridge import Received, bridge_program, received

_KILLS = int(os.environ.get("BRIDGE_KILLS", "15"))


async def all_there(hub: Hub, gateway: EventServer, within_s: float = 30.0) -> Received:
    """Waits until everything is there or announced."""

    def adds_up(found: Received) -> bool:
        return all([found.add_up_to(run, issued) for run, issued in gateway.happened.items()])

    return await eventually(lambda: received(hub), adds_up, "all is there or announced", within_s)


@pytest.mark.timeout(60 + 4 * _KILLS)
async def test_killed_at_random_instants_it_loses_and_repeats_nothing(
    tmp_path: Path, hub: Hub, gateway: EventServer, servers: NatsServers
) -> None:
    with bridge_program(tmp_path / "bridge", gateway.port, servers.urls) as bridge:
        for _ in range(_KILLS):
            end_s = asyncio.get_running_loop().time() + random.uniform(0.2, 3.0)
            bridge.start(wait=False)
            while asyncio.get_running_loop().time() < end_s:
                gateway.happen(random.randint(1, 5))
                await asyncio.sleep(0.01)
            bridge.kill()
        await asyncio.to_thread(bridge.start)
        found = await all_there(hub, gateway)
    (issued,) = gateway.happened.values()
    assert len(found.events) + len(found.missing) == issued
    assert len(found.events) > 0
