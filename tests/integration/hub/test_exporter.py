"""The exporter over a real hub, scraped over HTTP."""

import asyncio
import json
import urllib.request
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from fleet import names
from fleet.connection import FleetAddress, connect
from hub.exporter.app import export
from hub.exporter.collector import FleetCollector
from hub.jetstream.streams import set_up
from tests.support.eventually import eventually
from tests.support.fleet_values import healthy_state
from tests.support.nats_servers import NatsServers, nats_servers


async def scraped(port: int) -> str:
    def fetch() -> str:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=5) as answer:
            return str(answer.read().decode())

    return await asyncio.to_thread(fetch)


def holds(*lines: str) -> Callable[[str], bool]:
    return lambda text: set(lines) <= set(text.splitlines())


async def fill(servers: NatsServers, name: str) -> None:
    async with connect(FleetAddress(servers.urls)) as hub:
        await hub.connected(10)
        await set_up(hub, replicas=1)
        await hub.put(names.ROBOTS, name, json.dumps({"revoked": False}).encode())
        await hub.put(names.STATES, name, healthy_state(name).SerializeToString())
        await hub.put(names.STATES, "stranger", healthy_state("stranger").SerializeToString())


@asynccontextmanager
async def exporting(servers: NatsServers) -> AsyncIterator[int]:
    """The exporter runs; yields the port of its page."""
    stop, port = asyncio.Event(), asyncio.get_running_loop().create_future()
    task = asyncio.create_task(export(FleetAddress(servers.urls), "127.0.0.1", 0, stop, port.set_result))
    try:
        yield await port
    finally:
        stop.set()
        await task


async def test_it_follows_the_hub_over_an_outage(tmp_path: Path) -> None:
    with nats_servers(tmp_path) as servers:
        await fill(servers, "lab1")
        async with exporting(servers) as port:

            async def scrape() -> str:
                return await scraped(port)

            up = holds('robot_fleet_up{robot="lab1"} 1.0', "robot_fleet_hub_connected 1.0")
            text = await eventually(scrape, up, "the robot is up")
            assert "stranger" not in text
            full = holds('robot_fleet_stream_used_ratio{stream="KV_fleet_recordings"} 0.0')
            await eventually(scrape, full, "how full the streams are")
            await asyncio.to_thread(servers.kill, 0)
            gone = holds('robot_fleet_up{robot="lab1"} 1.0', "robot_fleet_hub_connected 0.0")
            await eventually(scrape, gone, "the hub is gone, the robot's last state is not")
            await asyncio.to_thread(servers.start_all)
            await fill(servers, "lab2")
            await eventually(scrape, holds('robot_fleet_up{robot="lab2"} 1.0'), "it is back", within_s=30)


async def test_a_defect_ends_the_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A page that shows the last state for ever would raise no alarm."""

    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(FleetCollector, "take_robot", broken)
    with nats_servers(tmp_path) as servers:
        await fill(servers, "lab1")
        with pytest.raises(ExceptionGroup) as ended:
            async with asyncio.timeout(20):
                await export(FleetAddress(servers.urls), "127.0.0.1", 0, asyncio.Event())
    assert ended.group_contains(ZeroDivisionError)
