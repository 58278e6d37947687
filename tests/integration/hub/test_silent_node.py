"""A node that stands still, or has lost its power: it answers nothing, and refuses nothing either."""

import asyncio
import itertools
import time
from collections.abc import Iterator
from contextlib import AsyncExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from fleet import names
from fleet.connection import FleetAddress, connect
from fleet.errors import HubReason
from hub import administration
from tests.support.promise import keeps, keeps_async
from tests.support.secure_hub import SecureHub, answer_to, secure_hub
from tests.support.silent_server import tried_in_order
from tests.support.waiting import wait_until

_REVOKED_WITHIN_S = 5.0
_LEARNED_WITHIN_S = 15.0
"""Both: docs/fleet.md. The second one is from when the node goes on."""


@pytest.fixture
def cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[SecureHub]:
    """Three nodes; the first one that the administration tries leads the list of robots."""
    monkeypatch.setattr("fleet.connection.random.shuffle", lambda _servers: None)
    # Enough for a machine that stands still itself.
    for bound in ("administration._CONNECT_S", "jetstream.electing.ELECTED_WITHIN_S"):
        monkeypatch.setattr(f"hub.{bound}", 30.0)
    with secure_hub(tmp_path, nodes=3) as hub:
        leader = hub.servers.leader(f"KV_{names.ROBOTS}")
        assert leader is not None
        record, first = hub.directory.read(), hub.servers.urls[leader]
        others = tuple(server for server in record.servers if server != first)
        assert len(others) == 2
        hub.directory.write(replace(record, servers=(first, *others)))
        yield hub


def _freeze_first(hub: SecureHub) -> int:
    """Returns the node that stands still from now on."""
    node = hub.servers.urls.index(hub.directory.read().servers[0])
    hub.servers.freeze(node)
    return node


@pytest.mark.timeout(300)  # up to seven elections of 30 s each, after a cluster has started
def test_it_keeps_the_administration_from_nothing(
    cluster: SecureHub, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The defect: nothing was done where it was tried first, or led what was to be changed."""
    robot = cluster.enroll("r1")
    tried_in_order(monkeypatch)
    frozen = _freeze_first(cluster)
    asyncio.run(administration.revoke(cluster.directory, "robot", "r1"))
    other = cluster.enroll("r2")
    assert asyncio.run(administration.apply(cluster.directory)) == []
    for node in {0, 1, 2} - {frozen}:
        assert answer_to(_at(cluster, robot, node)) is HubReason.REFUSED
        assert answer_to(_at(cluster, other, node)) is None


@pytest.mark.timed
@pytest.mark.timeout(300)  # up to four attempts, after a cluster has started
async def test_a_revoked_robot_is_out_of_the_others_in_time(cluster: SecureHub) -> None:
    frozen = await asyncio.to_thread(_freeze_first, cluster)
    running = [node for node in range(3) if node != frozen]
    robots = (f"r{number}" for number in itertools.count())

    async def out_s() -> float:
        name = next(robots)
        robot = await asyncio.to_thread(cluster.enroll, name)
        async with AsyncExitStack() as stack:
            hubs = [await stack.enter_async_context(connect(_at(cluster, robot, node))) for node in running]
            for hub in hubs:
                await hub.connected(20.0)
            begun_s = time.monotonic()
            revoking = asyncio.create_task(administration.revoke(cluster.directory, "robot", name))
            for hub in hubs:
                assert await hub.changed.wait_until(lambda hub=hub: not hub.link.connected, 30.0)  # type: ignore[misc]
            needed_s = time.monotonic() - begun_s
            await revoking
        return needed_s

    await keeps_async(_REVOKED_WITHIN_S, "s until a revoked robot is out of the nodes that run", out_s)


@pytest.mark.timed
@pytest.mark.timeout(300)  # up to four attempts of 15 s each, after a cluster has started
def test_when_it_goes_on_it_learns_who_is_revoked(cluster: SecureHub) -> None:
    names_of_robots = (f"r{number}" for number in itertools.count())

    def learned_s() -> float:
        name = next(names_of_robots)
        robot = cluster.enroll(name)
        node = _freeze_first(cluster)
        asyncio.run(administration.revoke(cluster.directory, "robot", name))
        cluster.servers.thaw(node)
        begun_s = time.monotonic()
        refused = partial(answer_to, _at(cluster, robot, node), once=True)
        wait_until(lambda: refused() is HubReason.REFUSED, f"node {node} refuses it", 60.0)
        return time.monotonic() - begun_s

    keeps(_LEARNED_WITHIN_S, "s until a node that goes on refuses who was revoked meanwhile", learned_s)


def _at(hub: SecureHub, address: FleetAddress, node: int) -> FleetAddress:
    return replace(address, servers=(hub.servers.urls[node],))
