"""What the bridge costs a robot at rest: a state and an event a second."""

import asyncio
import time
from pathlib import Path

import psutil
import pytest

from fleet.connection import Hub
from gateway.status.fault import Severity
from tests.support.event_server import EventServer
from tests.support.eventually import eventually
from tests.support.nats_servers import NatsServers
from tests.support.running_bridge import bridge_program, received
from tests.support.slowdown import Slowdown

pytestmark = [pytest.mark.timed, pytest.mark.alone]

_S = 20
_MIB = 1024 * 1024


async def test_an_event_and_a_state_a_second_cost_a_hundredth_of_a_core_and_80_mib(
    tmp_path: Path, hub: Hub, gateway: EventServer, servers: NatsServers
) -> None:
    """Each event changes the state as well: what waits in the outbox is a part of it.

    The time of the processor is that of one at its full speed.
    """
    slowdown = Slowdown()
    with bridge_program(tmp_path / "bridge", gateway.port, servers.urls) as bridge:
        await asyncio.to_thread(bridge.start)
        await eventually(lambda: received(hub), lambda found: found.batches, "it has begun")
        assert bridge.process
        process = psutil.Process(bridge.process.pid)
        before, began_s = process.cpu_times(), time.monotonic()
        for second in range(_S):
            gateway.happen(1, Severity.INFO)
            await asyncio.to_thread(slowdown.sample)
            await asyncio.sleep(began_s + second + 1 - time.monotonic())
        after, took_s = process.cpu_times(), time.monotonic() - began_s
        counted = (after.user + after.system - before.user - before.system) / took_s
        cpu = counted / slowdown.factor
        rss = process.memory_info().rss
        print(f"{cpu:.4f} of a core ({counted:.4f} counted), {rss / _MIB:.1f} MiB")
        found = await received(hub)
    assert len(found.events) == _S
    assert cpu <= 0.01, f"{counted:.4f} was counted, by a processor slowed down {slowdown.factor:.2f} times"
    assert rss <= 80 * _MIB
