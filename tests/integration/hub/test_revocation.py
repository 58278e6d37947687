"""Who is revoked stays out, whatever becomes of the servers' disks."""

import asyncio
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from fleet.connection import FleetAddress, connect
from fleet.errors import RefusedError
from hub.cli import app
from tests.support.nats_servers import DEBIAN_SERVER, SERVER
from tests.support.secure_hub import SecureHub, secure_hub

_SERVERS = [
    pytest.param(SERVER, id="newest"),
    pytest.param(
        DEBIAN_SERVER,
        id="debian",
        marks=pytest.mark.skipif(not DEBIAN_SERVER, reason="nats-server of Debian"),
    ),
]


@pytest.fixture(params=_SERVERS)
def hub(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[SecureHub]:
    with secure_hub(tmp_path, binary=request.param) as hub:
        yield hub


def test_a_server_that_starts_with_an_empty_disk_knows_who_is_revoked(hub: SecureHub) -> None:
    robot, other = hub.enroll("r1"), hub.enroll("r2")
    _type(hub, "revoke", "r1")
    _lose_accounts(hub)
    assert not _admits(robot)
    assert _admits(other)


def test_apply_ends_what_a_server_with_an_old_configuration_has_forgotten(hub: SecureHub) -> None:
    """The copy of the configuration on a server is as old as its installation."""
    robot, other = hub.enroll("r1"), hub.enroll("r2")
    config = hub.directory.path / "nodes" / "n0" / "nats.conf"
    installed = config.read_text(encoding="utf-8")
    _type(hub, "revoke", "r1")
    assert not _admits(robot)
    config.write_text(installed, encoding="utf-8")
    _lose_accounts(hub)
    assert _admits(robot), "why docs/fleet.md has it repeated"
    _type(hub, "apply")
    assert not _admits(robot)
    assert _admits(other)


def _type(hub: SecureHub, command: str, *words: str) -> None:
    done = CliRunner().invoke(
        app, [command, *words, "--dir", str(hub.directory.path)], catch_exceptions=False
    )
    assert done.exit_code == 0, done.output


def _lose_accounts(hub: SecureHub) -> None:
    """What a server has after its streams alone were restored."""
    hub.servers.stop(0)
    shutil.rmtree(hub.servers.directory / "n0" / "accounts")
    hub.servers.start_all()


def _admits(address: FleetAddress) -> bool:
    async def admitted() -> bool:
        async with connect(address) as robot:
            try:
                await robot.connected(2.0)
            except RefusedError:
                return False
            return True

    return asyncio.run(admitted())
