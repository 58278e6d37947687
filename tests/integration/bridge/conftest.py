"""A hub of one real server, and the gateway's event streams."""

from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest

from fleet.connection import FleetAddress, Hub, connect
from tests.support.event_server import EventServer
from tests.support.nats_servers import NatsServers, nats_servers
from tests.support.running_bridge import prepare


@pytest.fixture
def servers(tmp_path: Path) -> Iterator[NatsServers]:
    with nats_servers(tmp_path / "nats") as running:
        yield running


@pytest.fixture
async def hub(servers: NatsServers) -> AsyncIterator[Hub]:
    await prepare(servers.urls)
    async with connect(FleetAddress(servers.urls, name="test")) as hub:
        await hub.connected(10)
        yield hub


@pytest.fixture
async def gateway() -> AsyncIterator[EventServer]:
    async with EventServer(kept=1024) as server:
        yield server
