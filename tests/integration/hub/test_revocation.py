"""Who is revoked stays out, whatever becomes of the servers' disks."""

import asyncio
import itertools
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import AsyncExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from common.errors import UserError
from fleet import identity
from fleet.connection import FleetAddress, connect
from fleet.errors import HubError, HubReason
from hub import accounts, administration
from hub.cli import app
from tests.support.promise import keeps, keeps_async
from tests.support.secure_hub import BOTH_SERVERS, SecureHub, answer_to, secure_hub
from tests.support.waiting import wait_until

_REVOKED_WITHIN_S = 5.0
_LEARNED_WITHIN_S = 15.0
"""Both: docs/fleet.md. The second one is from a node's start, with the way back into the cluster."""
_COMPARED_EVERY_S = 2.0
"""hub/server_config.py: the resolver's interval."""


@pytest.fixture(params=BOTH_SERVERS)
def hub(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[SecureHub]:
    with secure_hub(tmp_path, binary=request.param) as hub:
        yield hub


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[SecureHub]:
    """Three nodes; the administrator reaches the first one alone."""
    with secure_hub(tmp_path, nodes=3) as hub:
        record = hub.directory.read()
        hub.directory.write(replace(record, servers=record.servers[:1]))
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


def test_a_revocation_that_servers_did_not_hear_of_is_in_their_configuration(hub: SecureHub) -> None:
    """One that is down, or has no connection left, reads it when it starts."""
    robot, other = hub.enroll("r1"), hub.enroll("r2")
    hub.servers.stop(0)
    with pytest.raises(UserError, match="can't be reached"):
        _type(hub, "revoke", "r1")
    hub.servers.start_all()
    assert not _admits(robot)
    assert _admits(other)


def test_credentials_of_a_clock_that_was_ahead_are_revoked_too(
    hub: SecureHub, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The defect: servers compare the time of issue with that of the revocation."""
    with monkeypatch.context() as ahead:
        ahead.setattr(identity, "time", SimpleNamespace(time=lambda: time.time() + 3600))
        robot = hub.enroll("r1")
    assert _admits(robot)
    _type(hub, "revoke", "r1")
    assert not _admits(robot)


def test_no_key_exists_that_is_not_listed(hub: SecureHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """It could never be revoked."""

    def full(_files: object) -> None:
        raise UserError("No space left on device")

    monkeypatch.setattr(administration, "write_all_private", full)
    out, directory = hub.path / "files", hub.directory
    issues: dict[str, Callable[[], None]] = {
        "robot": lambda: asyncio.run(administration.enroll(directory, "one", out)),
        "operator": lambda: administration.operator_files(directory, "one", out, days=None, again=False),
        "receiver": lambda: administration.receiver_files(directory, "one", out, days=None, again=False),
    }
    for kind, issue in issues.items():
        with pytest.raises(UserError, match="No space"):
            issue()
        assert any((each.kind, each.name) == (kind, "one") for each in directory.read().users)


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[SecureHub]:
    """Its server takes 24 connections, and 16 of robots."""
    monkeypatch.setitem(accounts.CONNECTIONS, "robots", 16)
    hub = SecureHub(tmp_path)
    config = hub.directory.path / "nodes" / "n0" / "nats.conf"
    text = config.read_text(encoding="utf-8")
    assert "max_connections: 4096\n" in text
    config.write_text(text.replace("max_connections: 4096", "max_connections: 24"), encoding="utf-8")
    try:
        hub.start()
        yield hub
    finally:
        hub.servers.close()


def test_a_key_that_takes_all_connections_of_robots_is_revoked(small: SecureHub) -> None:
    """The defect: it took those of the administration, too, which could not revoke it."""
    thief, other, reader = small.enroll("r1"), small.enroll("r2"), small.operator("reader")

    async def attack() -> None:
        async with AsyncExitStack() as stack:
            for _ in range(24):
                hub = await stack.enter_async_context(connect(thief))
                await hub.changed.wait_until(lambda hub=hub: hub.link.connected or hub.link.reason, 10.0)  # type: ignore[misc]
            assert "as many connections as it permits" in hub.link.text
            assert hub.link.reason is HubReason.UNREACHABLE, "its credentials are good"
            assert await asyncio.to_thread(_admits, reader)
            await asyncio.to_thread(_type, small, "revoke", "r1")

    asyncio.run(attack())
    assert not _admits(thief)
    assert _admits(other)


@pytest.mark.timed
@pytest.mark.timeout(300)  # up to four attempts, after a cluster has started
async def test_a_revoked_robot_is_out_of_every_node(cluster: SecureHub) -> None:
    robots = (f"r{number}" for number in itertools.count())

    async def out_s() -> float:
        name = next(robots)
        robot = await asyncio.to_thread(cluster.enroll, name)
        nodes = [_at(cluster, robot, node) for node in range(3)]
        async with AsyncExitStack() as stack:
            hubs = [await stack.enter_async_context(connect(each)) for each in nodes]
            for hub in hubs:
                await hub.connected(20.0)
            begun_s = time.monotonic()
            await administration.revoke(cluster.directory, "robot", name)
            for hub in hubs:
                assert await hub.changed.wait_until(lambda hub=hub: not hub.link.connected, 30.0)  # type: ignore[misc]
            needed_s = time.monotonic() - begun_s
        for each in nodes:
            assert not await asyncio.to_thread(_admits, each)
        return needed_s

    await keeps_async(_REVOKED_WITHIN_S, "s until a revoked robot is out of every node", out_s)


@pytest.mark.timed
@pytest.mark.timeout(300)  # up to four attempts of 15 s each, after a cluster has started
def test_a_node_that_was_down_learns_of_it_from_the_others(cluster: SecureHub) -> None:
    robots = (f"r{number}" for number in itertools.count())
    other = cluster.enroll("other")

    def learned_s() -> float:
        name = next(robots)
        robot = cluster.enroll(name)
        cluster.servers.kill(2)
        # Until the list of robots has a leader again, the administrator is to try again.
        wait_until(lambda: _revoked(cluster, name), "the robot is revoked", 60.0)
        begun_s = time.monotonic()
        cluster.servers.start(2)
        refused = partial(answer_to, _at(cluster, robot, 2), once=True)
        wait_until(lambda: refused() is HubReason.REFUSED, "node 2 refuses it", 60.0)
        needed_s = time.monotonic() - begun_s
        assert _admits(_at(cluster, other, 2))
        cluster.servers.wait_healthy()
        return needed_s

    keeps(_LEARNED_WITHIN_S, "s until a node that was down refuses who was revoked meanwhile", learned_s)


@pytest.mark.timed
@pytest.mark.timeout(300)  # two waits of a minute, after a cluster has started
def test_a_node_that_was_down_brings_no_older_accounts(
    cluster: SecureHub, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not even when the accounts had been given to it in the second of the revocation."""
    robot, other = cluster.enroll("r1"), cluster.enroll("r2")
    monkeypatch.setattr(administration, "_now_s", partial(int, time.time()))
    assert asyncio.run(administration.apply(cluster.directory)) == []
    cluster.servers.kill(2)
    wait_until(lambda: _revoked(cluster, "r1"), "the robot is revoked", 60.0)
    cluster.servers.start(2)
    refused = partial(answer_to, _at(cluster, robot, 2), once=True)
    # How long that may take is measured above.
    wait_until(lambda: refused() is HubReason.REFUSED, "node 2 refuses it", 60.0)
    compared_s = time.monotonic() + 2 * _COMPARED_EVERY_S
    while time.monotonic() < compared_s:
        assert not any(_admits(_at(cluster, robot, node)) for node in range(3))
    assert all(_admits(_at(cluster, other, node)) for node in range(3))


def _at(hub: SecureHub, address: FleetAddress, node: int) -> FleetAddress:
    return replace(address, servers=(hub.servers.urls[node],))


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


def _revoked(hub: SecureHub, robot: str) -> bool:
    try:
        asyncio.run(administration.revoke(hub.directory, "robot", robot))
    except HubError:
        return False
    return True


def _admits(address: FleetAddress) -> bool:
    reason = answer_to(address)
    assert reason in {None, HubReason.REFUSED}
    return reason is None
