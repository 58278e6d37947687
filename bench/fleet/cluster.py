"""A hub of three nodes, set up as `robot-bridge hub apply` does."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fleet.connection import FleetAddress, connect
from hub import streams
from tests.support.nats_servers import NatsServers, nats_servers

NODES = 3


@contextmanager
def cluster(directory: Path, nodes: int = NODES) -> Iterator[NatsServers]:
    """Up and set up when the block begins, gone when it ends."""
    with nats_servers(directory, nodes) as servers:
        asyncio.run(_set_up(servers, nodes))
        yield servers


async def _set_up(servers: NatsServers, replicas: int) -> None:
    async with connect(FleetAddress(servers.urls)) as hub:
        await hub.connected(20)
        await streams.set_up(hub, replicas, streams.StreamLimits())
