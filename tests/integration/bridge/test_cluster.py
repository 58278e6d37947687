"""The bridge with credentials of its own at a cluster of three, whose servers are killed or fall silent."""

import asyncio
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, aclosing
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from fleet import names
from fleet.connection import Hub, Start, connect
from fleet.errors import HubError
from omniseer.fleet.v1.event_pb2 import EventBatch
from tests.support.event_server import EventServer
from tests.support.eventually import at_most, eventually
from tests.support.promise import keeps_async
from tests.support.running_bridge import ROBOT, BridgeProgram, Received, bridge_program, received
from tests.support.secure_hub import SecureHub, secure_hub
from tests.support.waiting import wait_until

pytestmark = pytest.mark.timed

_LONGEST_GAP_S = 15.0
"""docs/fleet.md: so long events wait in the robot when a server dies, or is silent."""
_EVENTS = 30


@pytest.fixture
def secure(tmp_path: Path) -> Iterator[SecureHub]:
    with secure_hub(tmp_path / "secure", 3) as hub:
        hub.enroll(ROBOT)
        yield hub


def bridge_of(
    secure: SecureHub, directory: Path, gateway: EventServer
) -> AbstractContextManager[BridgeProgram]:
    """The enrolled robot's bridge, not started yet."""
    hub = {
        "servers": list(secure.servers.urls),
        "credentials": str(secure.path / ROBOT / "bridge.creds"),
        "ca": str(secure.directory.ca_file),
        "robot": ROBOT,
        "fleet": "lab",
    }
    return bridge_program(directory, gateway.port, secure.servers.urls, hub=hub)


async def seen(hub: Hub) -> Received | None:
    """What an operator sees; None while the operator's own server is gone."""
    try:
        return await received(hub)
    except HubError:
        return None


@pytest.mark.timeout(300)  # up to four attempts of 15 s with each server, after a cluster has started
async def test_each_server_killed_in_turn_costs_no_event(
    tmp_path: Path, secure: SecureHub, gateway: EventServer
) -> None:
    run = gateway.newest.run_id

    def all_there(found: Received | None) -> bool:
        return found is not None and found.add_up_to(run, gateway.happened[run])

    async with connect(secure.operator("eve")) as hub:

        async def waited_s(node: int) -> float:
            gateway.happen(_EVENTS)
            begun_s = time.monotonic()
            secure.servers.kill(node)
            gateway.happen(_EVENTS)
            try:
                await eventually(lambda: seen(hub), all_there, f"without n{node}", 60.0)
                return time.monotonic() - begun_s
            finally:
                await asyncio.to_thread(secure.servers.start_all)

        with bridge_of(secure, tmp_path / "bridge", gateway) as bridge:
            await asyncio.to_thread(bridge.start)
            await eventually(
                lambda: seen(hub), lambda found: found and found.batches, "the bridge has begun", 40
            )
            for node in range(3):
                await keeps_async(
                    _LONGEST_GAP_S, f"s until all events are there without n{node}", partial(waited_s, node)
                )
            found = await eventually(lambda: seen(hub), all_there, "all are there", 60.0)
    assert found
    assert len(found.events) == gateway.happened[run] >= 3 * 2 * _EVENTS


@pytest.mark.timeout(300)  # up to four attempts of 15 s each, after a cluster has started
async def test_a_server_that_falls_silent_holds_events_up_no_longer(
    tmp_path: Path, secure: SecureHub, gateway: EventServer
) -> None:
    """As one that loses its power: nothing ends the connection, and nothing refuses another one."""
    run, servers = gateway.newest.run_id, secure.servers
    reader = secure.operator("eve")

    async def waited_s() -> float:
        node = await asyncio.to_thread(node_of_bridge, secure)
        others = tuple(url for url in servers.urls if url != servers.urls[node])
        async with connect(replace(reader, servers=others)) as hub:
            await hub.connected(20)
            await asyncio.to_thread(servers.freeze, node)
            try:
                begun_unix_s = time.time()
                gateway.happen(_EVENTS)
                async with at_most(60, "the hub takes the events"):
                    taken_unix_s = await taken(hub, run, gateway.happened[run])
                return taken_unix_s - begun_unix_s
            finally:
                servers.thaw(node)
                await asyncio.to_thread(servers.wait_healthy)

    async with connect(reader) as hub:
        with bridge_of(secure, tmp_path / "bridge", gateway) as bridge:
            await asyncio.to_thread(bridge.start)
            await eventually(
                lambda: seen(hub), lambda found: found and found.batches, "the bridge has begun", 40
            )
            await keeps_async(_LONGEST_GAP_S, "s that events wait for another server", waited_s)
            # A node that goes on has to catch up before it says the same as the others.
            await eventually(
                lambda: seen(hub),
                lambda found: found and found.add_up_to(run, gateway.happened[run]),
                "each is there once, in order",
                60,
            )


def node_of_bridge(secure: SecureHub) -> int:
    """The server that the bridge is connected with."""

    def the_only_one() -> list[int] | None:
        found = [
            node
            for node in range(3)
            for each in secure.servers.monitor(node, "connz")["connections"]
            if each.get("name") == f"robot-bridge {ROBOT}"
        ]
        # Where it has gone over to another one, the first one may list it for a while.
        return found if len(found) == 1 else None

    return wait_until(the_only_one, "it has one connection", 60.0)[0]


async def taken(hub: Hub, run: str, last: int) -> float:
    """When the hub took the event with this sequence, by its own clock, which is this machine's."""
    async with aclosing(hub.follow(names.EVENTS, names.event_subjects(ROBOT), Start.all())) as messages:
        async for message in messages:
            batch = EventBatch.FromString(message.payload)
            if (batch.run_id, batch.last_sequence) == (run, last):
                return message.unix_s
    raise AssertionError("a stream that is followed has no end")
