"""Where uploads go in tests: a hub with identities, a store, and the way to it, as fixtures."""

from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from fleet.connection import Hub, connect
from fleet.receipt_keys import read_public_keys
from hub.receiver.config import ReceiverSettings, StoreSettings
from tests.support.s3_server import FaultyStore, S3Server, faulty_store, s3_server
from tests.support.secure_hub import SecureHub, secure_hub
from tests.support.uploading import ROBOT, receiver_settings


@dataclass
class Ground:
    """Where a test's recordings go.

    Attributes:
        server: the store.
        proxy: the way to it.
        store: how receivers reach a bucket of the test's own.
        hub: the robot's connection.
        keys: of receipts, as the robot has them from its enrolment.
        receivers: settings of two receivers.
    """

    server: S3Server
    proxy: FaultyStore
    store: StoreSettings
    hub: Hub
    keys: tuple[bytes, ...]
    receivers: tuple[ReceiverSettings, ReceiverSettings]


@pytest.fixture(scope="module")
def store_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[S3Server]:
    with s3_server(tmp_path_factory.mktemp("s3")) as server:
        yield server


@pytest.fixture(scope="module")
def secure(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SecureHub]:
    with secure_hub(tmp_path_factory.mktemp("hub")) as hub:
        hub.enroll(ROBOT)
        hub.receiver()
        yield hub


@pytest.fixture
async def ground(store_server: S3Server, secure: SecureHub, tmp_path: Path) -> AsyncIterator[Ground]:
    files = secure.path / ROBOT
    address = secure.address(files / "bridge.creds", f"_INBOX_{ROBOT}")
    async with faulty_store(store_server) as proxy, connect(address) as hub:
        await hub.connected(20)
        store = store_server.settings(public_endpoint=proxy.url)
        receivers = [receiver_settings(secure, store, tmp_path, number) for number in (1, 2)]
        keys = read_public_keys(files / "receipts.pub")
        yield Ground(store_server, proxy, store, hub, keys, (receivers[0], receivers[1]))
