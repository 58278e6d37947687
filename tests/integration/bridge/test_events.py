"""Events on their way to a real hub: received = issued - announced gaps, none twice, in order.

BRIDGE_KILLS=200 in the environment kills many times.
"""

import asyncio
import errno
import itertools
import os
import random
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from fleet.connection import Hub
from gateway.status.fault import Severity
from omniseer.fleet.v1.event_pb2 import (
    DROP_REASON_DISK,
    DROP_REASON_OUTBOX_FULL,
    DROP_REASON_OUTBOX_LOST,
)
from omniseer.gateway.v1 import cloud_pb2
from tests.support.calendar_clock import CalendarClock
from tests.support.event_server import EventServer
from tests.support.eventually import eventually
from tests.support.nats_servers import NatsServers
from tests.support.promise import keeps_async
from tests.support.relay import Relay
from tests.support.running_bridge import BridgeProgram, Received, bridge_program, received

_KILLS = int(os.environ.get("BRIDGE_KILLS", "15"))
_PERIODS = 5
_HALF_OPEN_S = 15.0
"""docs/fleet.md."""


async def all_there(hub: Hub, gateway: EventServer, within_s: float = 60.0) -> Received:
    """Waits until everything is there or announced."""
    return await eventually(
        lambda: received(hub),
        lambda found: all_adds_up(found, gateway),
        "all is there or announced",
        within_s,
    )


def all_adds_up(found: Received, gateway: EventServer) -> bool:
    """Whether all events of all runs are there or announced."""
    return all(found.add_up_to(run, issued) for run, issued in gateway.happened.items())


async def begin(bridge: BridgeProgram, hub: Hub) -> None:
    """Starts a bridge; what happens from now on is after what its new outbox does not know."""
    await asyncio.to_thread(bridge.start)
    await eventually(lambda: received(hub), lambda found: found.batches, "it has begun", 40.0)


async def kept_up(bridge: BridgeProgram, least: int) -> None:
    """Waits until the bridge has taken so many events."""

    def enough(status: cloud_pb2.CloudStatus) -> bool:
        return status.outbox_events + status.events_dropped >= least

    await eventually(lambda: status_of(bridge), enough, "the bridge keeps up", 40.0)


async def status_of(bridge: BridgeProgram) -> cloud_pb2.CloudStatus:
    return await asyncio.to_thread(lambda: bridge.status)


@contextmanager
def small_disk(directory: Path, mib: int) -> Iterator[Path]:
    """A file system of its own."""
    directory.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={mib}m", "tmpfs", str(directory)]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("mounting a small disk needs root")
    try:
        yield directory
    finally:
        subprocess.run(["umount", "-l", str(directory)], check=True)


def fill(path: Path) -> None:
    """Takes all that is left of a disk."""
    with path.open("wb", buffering=0) as file:
        try:
            while True:
                file.write(bytes(4096))
        except OSError as error:
            if error.errno != errno.ENOSPC:
                raise


@pytest.mark.timeout(60 + 4 * _KILLS)
async def test_killed_at_random_instants_it_loses_and_repeats_nothing(
    tmp_path: Path, hub: Hub, gateway: EventServer, servers: NatsServers
) -> None:
    with bridge_program(tmp_path / "bridge", gateway.port, servers.urls) as bridge:
        await begin(bridge, hub)
        delivered = 0
        for _ in range(_KILLS):
            # Killed again and again before it takes anything, it would lose what the gateway keeps no longer:
            # 1024 events, of which up to 401 happen in each round.
            if sum(gateway.happened.values()) - delivered > 1024 - 401:
                delivered = len((await all_there(hub, gateway)).events)
            end_s = asyncio.get_running_loop().time() + random.uniform(0.0, 0.8)
            while asyncio.get_running_loop().time() < end_s:
                gateway.happen(random.randint(1, 5))
                await asyncio.sleep(0.01)
            bridge.kill()
            gateway.happen(1)
            # Half of the time it is killed again while it starts and recovers.
            await asyncio.to_thread(bridge.start, wait=random.random() < 0.5)
        found = await all_there(hub, gateway)
    (issued,) = gateway.happened.values()
    assert len(found.events) == issued, "the gateway has kept what a killed bridge had not taken"


async def test_restarted_gateways_are_runs_of_their_own(
    tmp_path: Path, hub: Hub, gateway: EventServer, servers: NatsServers
) -> None:
    with bridge_program(tmp_path / "bridge", gateway.port, servers.urls) as bridge:
        await begin(bridge, hub)
        for _ in range(3):
            gateway.happen(100)
            await all_there(hub, gateway)
            await gateway.restart()
            gateway.happen(5)
        found = await all_there(hub, gateway)
    assert len(gateway.happened) == 4
    firsts = {batch.run_id: batch.items[0].dropped for batch in reversed(found.batches)}
    assert all(first.earlier_run_incomplete for first in firsts.values()), (
        "what the run before had is not known"
    )
    assert len(found.events) == 315


async def test_a_hub_that_is_gone_for_longer_than_the_outbox_holds(
    tmp_path: Path, hub: Hub, gateway: EventServer, servers: NatsServers
) -> None:
    async with Relay(servers.ports[0]) as relay:
        urls = (f"nats://127.0.0.1:{relay.port}",)
        settings = {"outbox": {"max_bytes": 8 * 1024 * 1024}}
        with bridge_program(tmp_path / "bridge", gateway.port, urls, **settings) as bridge:
            await begin(bridge, hub)
            relay.open = False
            relay.cut()
            size = 0
            for number in range(120):
                severity = Severity.WARNING if number % 10 == 0 else Severity.INFO
                gateway.happen(100, severity, 1000)
                await kept_up(bridge, (number + 1) * 100 - 500)
                size = max(size, sum(path.stat().st_size for path in bridge.root.iterdir()))
            status = await status_of(bridge)
            assert status.state == cloud_pb2.CLOUD_STATE_OFFLINE
            assert status.last_error
            assert size <= 8 * 1024 * 1024
            relay.open = True
            found = await all_there(hub, gateway, 100)
            status = await status_of(bridge)
    assert found.reasons == {DROP_REASON_OUTBOX_LOST, DROP_REASON_OUTBOX_FULL}
    assert status.events_dropped == len(found.missing) > 1000
    assert len(found.events) + len(found.missing) == 12_000
    warnings = [item for batch in found.batches for item in batch.items if item.event.severity == 2]
    assert len(warnings) == 1200, "what matters more was kept"


@pytest.mark.timed
@pytest.mark.timeout(300)  # up to four attempts of 15 s each
async def test_a_half_open_connection_is_given_up(
    tmp_path: Path, hub: Hub, gateway: EventServer, servers: NatsServers
) -> None:
    async with Relay(servers.ports[0]) as relay:
        urls = (f"nats://127.0.0.1:{relay.port}",)
        with bridge_program(tmp_path / "bridge", gateway.port, urls) as bridge:

            async def noticed_s() -> float:
                begun_s = time.monotonic()
                relay.frozen = True
                gateway.happen(50)
                try:
                    await eventually(
                        lambda: status_of(bridge),
                        lambda status: status.state == cloud_pb2.CLOUD_STATE_OFFLINE,
                        "the bridge notices",
                        60.0,
                    )
                    needed_s = time.monotonic() - begun_s
                finally:
                    relay.frozen = False
                await all_there(hub, gateway)
                return needed_s

            await begin(bridge, hub)
            await keeps_async(_HALF_OPEN_S, "s until a half-open connection is given up", noticed_s)
            found = await received(hub)
    assert len(found.events) == sum(gateway.happened.values()) >= 50


@pytest.mark.timed
async def test_an_uplink_that_works_for_a_hundredth_of_the_time(
    tmp_path: Path, hub: Hub, gateway: EventServer, servers: NatsServers
) -> None:
    """Up for 30 ms of every 3 s until the end, and every third time the connection is reset after that."""
    async with Relay(servers.ports[0]) as relay, asyncio.timeout(100):
        urls = (f"nats://127.0.0.1:{relay.port}",)
        with bridge_program(tmp_path / "bridge", gateway.port, urls) as bridge:
            await begin(bridge, hub)
            for period in itertools.count():
                relay.through.clear()
                await asyncio.sleep(2.97)
                if period < _PERIODS:
                    gateway.happen(30)
                elif all_adds_up(found := await received(hub), gateway):
                    break
                relay.through.set()
                await asyncio.sleep(0.03)
                if period % 3 == 2:
                    relay.cut()
    assert len(found.events) == 30 * _PERIODS


async def test_an_outbox_that_was_cut_costs_what_it_says(
    tmp_path: Path, hub: Hub, gateway: EventServer, servers: NatsServers
) -> None:
    async with Relay(servers.ports[0]) as relay:
        urls = (f"nats://127.0.0.1:{relay.port}",)
        with bridge_program(tmp_path / "bridge", gateway.port, urls) as bridge:
            await begin(bridge, hub)
            for length in (0, 4096, 20_000):
                gateway.happen(200)
                await all_there(hub, gateway)
                relay.open = False
                relay.cut()
                gateway.happen(100)
                await eventually(
                    lambda: status_of(bridge),
                    lambda status: status.outbox_events >= 100,
                    "the outbox has them",
                    40.0,
                )
                bridge.kill()
                os.truncate(bridge.root / "outbox.db", length)
                (bridge.root / "outbox.db-wal").unlink()
                relay.open = True
                await asyncio.to_thread(bridge.start)
                found = await all_there(hub, gateway)
    # The gateway still kept what the outbox lost.
    assert len(found.events) == 900


async def test_what_a_cut_outbox_alone_had_is_announced(
    tmp_path: Path, hub: Hub, gateway: EventServer, servers: NatsServers
) -> None:
    async with Relay(servers.ports[0]) as relay:
        urls = (f"nats://127.0.0.1:{relay.port}",)
        with bridge_program(tmp_path / "bridge", gateway.port, urls) as bridge:
            await begin(bridge, hub)
            gateway.happen(200)
            await all_there(hub, gateway)
            relay.open = False
            relay.cut()
            for taken in range(500, 2001, 500):
                gateway.happen(500)
                await kept_up(bridge, taken)
            bridge.kill()
            os.truncate(bridge.root / "outbox.db", 4096)
            (bridge.root / "outbox.db-wal").unlink()
            relay.open = True
            await asyncio.to_thread(bridge.start)
            found = await all_there(hub, gateway)
    # The gateway keeps 1024: 200 had been delivered, and the others of the outbox are gone.
    assert len(found.events) == 200 + 1024
    assert found.missing >= {("run-1", sequence) for sequence in range(201, 2201 - 1024)}


async def test_a_run_that_ended_while_the_hub_was_away_is_delivered(
    tmp_path: Path, hub: Hub, gateway: EventServer, servers: NatsServers
) -> None:
    async with Relay(servers.ports[0]) as relay:
        urls = (f"nats://127.0.0.1:{relay.port}",)
        with bridge_program(tmp_path / "bridge", gateway.port, urls) as bridge:
            await begin(bridge, hub)
            relay.open = False
            relay.cut()
            gateway.happen(100)
            await kept_up(bridge, 100)
            await gateway.restart()
            gateway.happen(50)
            await kept_up(bridge, 150)
            bridge.kill()
            await asyncio.to_thread(bridge.start)
            relay.open = True
            found = await all_there(hub, gateway)
    assert len(found.events) == 150


async def test_a_disk_that_is_full_is_a_fault_and_then_a_gap(
    tmp_path: Path, hub: Hub, gateway: EventServer, servers: NatsServers
) -> None:
    with (
        small_disk(tmp_path / "disk", 4) as disk,
        bridge_program(tmp_path / "bridge", gateway.port, servers.urls, root=str(disk / "outbox")) as bridge,
    ):
        await asyncio.to_thread(bridge.start)
        gateway.happen(10)
        await all_there(hub, gateway)
        filled = disk / "others"
        fill(filled)
        gateway.happen(2000, length=1000)
        await eventually(
            lambda: status_of(bridge),
            lambda status: status.state == cloud_pb2.CLOUD_STATE_FAULTED and "full" in status.last_error,
            "it says what is wrong",
            40.0,
        )
        gateway.happen(1100)
        filled.unlink()
        found = await all_there(hub, gateway, 60)
        status = await status_of(bridge)
    assert status.state == cloud_pb2.CLOUD_STATE_CONNECTED
    assert DROP_REASON_DISK in found.reasons
    (issued,) = gateway.happened.values()
    assert len(found.events) + len(found.missing) == issued


@pytest.mark.parametrize("step_s", [-3600, 3600])
async def test_steps_of_the_calendar_clock_change_nothing(
    tmp_path: Path, hub: Hub, gateway: EventServer, servers: NatsServers, step_s: int
) -> None:
    clock = CalendarClock(tmp_path)
    with bridge_program(tmp_path / "bridge", gateway.port, servers.urls) as bridge:
        bridge.environment = clock.environment
        await asyncio.to_thread(bridge.start)
        gateway.happen(10)
        await all_there(hub, gateway)
        clock.step(step_s)
        gateway.happen(10)
        found = await all_there(hub, gateway)
    assert len(found.events) + len(found.missing) == 20
