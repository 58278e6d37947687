"""A hub of one real server, and the gateway's event streams."""

from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest

from fleet.connection import FleetAddress, Hub, connect
from fleet.names import COMMANDS, time_subject
from tests.support.event_server import EventServer
from tests.support.nats_servers import NatsServers, nats_servers
from tests.support.running_bridge import prepare


@pytest.fixture
def servers(tmp_path: Path) -> Iterator[NatsServers]:
    # As a hub's accounts have it: a robot asks for the time under a name of its own.
    time = f'mappings = {{"{time_subject("*")}": "$JS.API.CONSUMER.INFO.{COMMANDS}.$1"}}\n'
    with nats_servers(tmp_path / "nats", config=lambda _node: time) as running:
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
