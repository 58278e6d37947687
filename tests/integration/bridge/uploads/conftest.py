"""A hub of one node, a store, and the way to it, for the files of this folder."""

from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from fleet.connection import FleetAddress, Hub, connect
from hub.receiver.config import StoreSettings
from hub.streams import set_up
from tests.support.nats_servers import NatsServers, nats_servers
from tests.support.s3_server import FaultyStore, S3Server, faulty_store, s3_server
from tests.support.uploading import Keys


@dataclass
class Ground:
    """Where a test's recordings go.

    Attributes:
        server: the store.
        proxy: the way to it.
        store: how receivers reach a bucket of the test's own.
        nats: the hub's servers.
        hub: the robot's connection.
        keys: of receipts.
    """

    server: S3Server
    proxy: FaultyStore
    store: StoreSettings
    nats: NatsServers
    hub: Hub
    keys: Keys


@pytest.fixture(scope="module")
def store_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[S3Server]:
    with s3_server(tmp_path_factory.mktemp("s3")) as server:
        yield server


@pytest.fixture(scope="module")
def nats(tmp_path_factory: pytest.TempPathFactory) -> Iterator[NatsServers]:
    with nats_servers(tmp_path_factory.mktemp("nats")) as servers:
        yield servers


@pytest.fixture
async def ground(store_server: S3Server, nats: NatsServers, tmp_path: Path) -> AsyncIterator[Ground]:
    async with (
        faulty_store(store_server) as proxy,
        connect(FleetAddress(nats.urls, inbox="_INBOX_r1")) as hub,
    ):
        await hub.connected(20)
        await set_up(hub, 1)
        store = store_server.settings(public_endpoint=proxy.url)
        yield Ground(store_server, proxy, store, nats, hub, Keys(tmp_path))
