"""A cluster of three keeps every event, whichever node is killed."""

import asyncio
from collections.abc import Iterator
from contextlib import aclosing, closing
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from fleet import names
from fleet.connection import FleetAddress, Hub, Published, Start, connect
from fleet.errors import HubError, HubReason
from hub.accounts import account_keys
from hub.jetstream import streams
from tests.support.eventually import eventually
from tests.support.hub_patience import in_the_end
from tests.support.nats_servers import NatsServers, nats_servers
from tests.support.secure_hub import SecureHub, secure_hub
from tests.support.simulated_fleet import received, simulated_fleet

MIB = 1024 * 1024
DAY_NS = 86_400 * 10**9
_LONGEST_GAP_S = 15.0
"""docs/fleet.md."""


async def _set_up(servers: NatsServers, replicas: int, limits: streams.StreamLimits | None = None) -> None:
    async with connect(FleetAddress(servers.urls)) as hub:
        await hub.connected(20)
        assert await streams.set_up(hub, replicas, limits or streams.StreamLimits()) == []


@pytest.mark.timed
async def test_a_killed_leader_costs_no_event(tmp_path: Path) -> None:
    """The whole proof, with every node killed in turn, is `scripts/bench fleet`."""
    robots, messages = 100, 10
    with nats_servers(tmp_path, 3) as servers:
        await _set_up(servers, 3)
        async with simulated_fleet(FleetAddress(servers.urls), robots) as fleet, asyncio.TaskGroup() as tasks:
            sending = tasks.create_task(fleet.send(range(messages)))
            await fleet.sent_at_least(robots * messages // 4)
            leader = servers.leader(names.EVENTS)
            assert leader is not None
            servers.kill(leader)
            await sending
            assert fleet.longest_s < _LONGEST_GAP_S
        result = await received(FleetAddress(servers.urls), robots, messages)
    assert (result.lost, result.duplicates, result.disordered) == (0, 0, 0)


def test_each_node_has_loaded_all_accounts_before_it_is_reached(tmp_path: Path) -> None:
    """The defect: two nodes that loaded one at the same moment left it expired, and refused its users."""
    hub = SecureHub(tmp_path, 3)
    keys = account_keys(hub.directory)
    accounts = {key.public for name, key in keys.items() if name != "operator"}
    with closing(hub.servers):
        hub.servers.start_all()
        for node in range(3):
            assert accounts <= set(hub.servers.monitor(node, "accountz")["accounts"])
            for account in accounts:
                found = hub.servers.monitor(node, f"accountz?acc={account}")["account_detail"]
                assert (found["expired"], found["complete"]) == (False, True)


async def test_a_full_hub_refuses_and_loses_nothing(tmp_path: Path) -> None:
    """Publishers wait until there is room; what they had delivered before is there."""
    limits = streams.StreamLimits(events_bytes=64 * 1024)
    with nats_servers(tmp_path, 1) as servers:
        await _set_up(servers, 1, limits)
        async with connect(FleetAddress(servers.urls)) as hub:
            await hub.connected(10)
            for delivered in range(10):
                await hub.publish_once(names.event_subject("r", "run", delivered), b"x" * 4096)
            with pytest.raises(HubError) as refused:  # noqa: PT012  # which of them is refused, the store says
                for delivered in range(10, 20):
                    await hub.publish_once(names.event_subject("r", "run", delivered), b"x" * 4096)
            assert refused.value.reason is HubReason.FULL
            # A repeat is still known as one, and the first is still there.
            assert (
                await hub.publish_once(names.event_subject("r", "run", 0), b"x" * 4096) is Published.REPEATED
            )
            await streams.set_up(hub, 1, streams.StreamLimits(events_bytes=MIB))
            subject = names.event_subject("r", "run", delivered)
            assert await hub.publish_once(subject, b"x" * 4096) is Published.DELIVERED
        assert (await received(FleetAddress(servers.urls), 1, delivered + 1)).lost == 0


async def test_existing_streams_get_more_room_and_never_less(tmp_path: Path) -> None:
    chosen = streams.StreamLimits(events_bytes=2 * MIB, events_days=40, recordings_bytes=2048 * MIB)
    less = streams.StreamLimits(events_bytes=MIB, events_days=39, recordings_bytes=1024 * MIB)
    recordings = f"KV_{names.RECORDINGS}"

    async def limits(hub: Hub) -> list[tuple[int, int]]:
        infos = [await hub.stream_info(name) for name in (names.EVENTS, names.RESULTS, recordings)]
        return [(info["config"]["max_bytes"], info["config"]["max_age"] // DAY_NS) for info in infos]

    with nats_servers(tmp_path, 1) as servers:
        await _set_up(servers, 1, streams.StreamLimits(events_bytes=MIB, events_days=3))
        async with connect(FleetAddress(servers.urls)) as hub:
            await hub.connected(10)
            assert await limits(hub) == [(MIB, 3), (256 * MIB, 3), (1024 * MIB, 0)]
            assert await streams.set_up(hub, 1, chosen) == []
            grown = await limits(hub)
            assert grown == [(2 * MIB, 40), (256 * MIB, 40), (2048 * MIB, 0)]
            # Without a choice, they stay as someone has chosen them.
            assert await streams.set_up(hub, 1) == []
            assert len(await streams.set_up(hub, 1, less)) == 4
            assert await limits(hub) == grown


@pytest.mark.timeout(300)  # of which the nodes may take a minute each to start, and to elect
async def test_without_a_majority_nothing_is_acknowledged(tmp_path: Path) -> None:
    with nats_servers(tmp_path, 3) as servers:
        await _set_up(servers, 3)
        async with connect(FleetAddress(servers.urls)) as hub:
            await hub.connected(10)
            survivor = servers.urls.index(hub.link.server)
            for node in {0, 1, 2} - {survivor}:
                servers.kill(node)
            with pytest.raises(HubError) as refused:
                await hub.publish_once("fleet.r.ev.run.0", b"", 2.0)
            unsure = {HubReason.TIMEOUT, HubReason.NO_RESPONDERS, HubReason.NO_QUORUM, HubReason.UNREACHABLE}
            assert refused.value.reason in unsure
            servers.start((survivor + 1) % 3)
            await in_the_end(partial(hub.publish_once, "fleet.r.ev.run.0", b"", 2.0))
        result = await received(FleetAddress(servers.urls), 1, 1)
    assert (result.lost, result.duplicates) == (0, 0), result


@pytest.fixture
def secure(tmp_path: Path) -> Iterator[SecureHub]:
    with secure_hub(tmp_path, 3) as hub:
        yield hub


@pytest.mark.timeout(300)  # of which the nodes may take a minute each to start, and to elect
async def test_people_read_at_every_node_and_go_on_without_one(secure: SecureHub) -> None:
    """Each node answers them, in the name of an account that has no streams."""
    reader = secure.operator("reader")
    async with connect(secure.administrator()) as administrator, connect(reader) as hub:
        for each in (administrator, hub):
            await each.connected(20)
        await in_the_end(partial(administrator.put, names.STATES, "r1", b"state"))
        for url in secure.servers.urls:
            async with connect(replace(reader, servers=(url,))) as at_node:
                await at_node.connected(20)
                read = partial(in_the_end, partial(at_node.entries, names.STATES))
                await eventually(read, lambda found: "r1" in found, "the node has caught up", 60.0)
                info = await in_the_end(partial(at_node.stream_info, names.EVENTS))
                assert info["state"]["messages"] == 0
        subjects = [names.event_subject("r1", "run", number) for number in range(2)]
        async with aclosing(hub.follow(names.EVENTS, "fleet.r1.ev.>", Start.all())) as events:
            await in_the_end(partial(administrator.publish_once, subjects[0], b""))
            assert (await anext(events)).subject == subjects[0]
            await hub.connected(20)
            await asyncio.to_thread(secure.servers.kill, secure.servers.urls.index(hub.link.server))
            await in_the_end(partial(administrator.publish_once, subjects[1], b"", 2.0))
            assert (await anext(events)).subject == subjects[1]
