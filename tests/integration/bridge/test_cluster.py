"""The bridge with credentials of its own at a cluster of three: each server is killed in turn."""

import asyncio
from collections.abc import Iterator
from pathlib import Path

import pytest

from fleet.connection import Hub, connect
from fleet.errors import HubError
from tests.support.event_server import EventServer
from tests.support.eventually import eventually
from tests.support.running_bridge import ROBOT, Received, bridge_program, received
from tests.support.secure_hub import SecureHub, secure_hub

pytestmark = pytest.mark.timed

_LONGEST_GAP_S = 15.0
"""docs/fleet.md: so long events wait in the robot when a server dies."""
_EVENTS = 30


@pytest.fixture
def secure(tmp_path: Path) -> Iterator[SecureHub]:
    with secure_hub(tmp_path / "secure", 3) as hub:
        hub.enroll(ROBOT)
        yield hub


async def seen(hub: Hub) -> Received | None:
    """What an operator sees; None while the operator's own server is gone."""
    try:
        return await received(hub)
    except HubError:
        return None


async def test_each_server_killed_in_turn_costs_no_event(
    tmp_path: Path, secure: SecureHub, gateway: EventServer
) -> None:
    files = secure.path / ROBOT
    settings = {
        "hub": {
            "servers": list(secure.servers.urls),
            "credentials": str(files / "bridge.creds"),
            "ca": str(secure.directory.ca_file),
            "robot": ROBOT,
            "fleet": "lab",
        }
    }
    run = gateway.newest.run_id

    def all_there(found: Received | None) -> bool:
        return found is not None and found.add_up_to(run, gateway.happened[run])

    async with connect(secure.operator("eve")) as hub:
        with bridge_program(tmp_path / "bridge", gateway.port, secure.servers.urls, **settings) as bridge:
            await asyncio.to_thread(bridge.start)
            await eventually(
                lambda: seen(hub), lambda found: found and found.batches, "the bridge has begun", 40
            )
            for node in range(3):
                gateway.happen(_EVENTS)
                secure.servers.kill(node)
                gateway.happen(_EVENTS)
                await eventually(lambda: seen(hub), all_there, f"without n{node}", _LONGEST_GAP_S)
                await asyncio.to_thread(secure.servers.start_all)
            found = await eventually(lambda: seen(hub), all_there, "all are there", _LONGEST_GAP_S)
    assert found
    assert len(found.events) == 3 * 2 * _EVENTS
