"""An outbox that is lost while the bridge runs costs what it announces, and nothing else."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from itertools import pairwise
from pathlib import Path

import pytest

from bridge.config import GatewaySettings
from bridge.events.values import Event, Item
from bridge.outbox.cursor import NAME as CURSOR
from bridge.outbox.database import NAME
from bridge.outbox.errors import OutboxError
from bridge.outbox.outbox import Outbox, outbox
from bridge.robot.events import EventReader
from common.tasks import cancel
from tests.support.event_server import EventServer
from tests.support.eventually import eventually

RUN = "run-1"


@pytest.fixture
async def kept(tmp_path: Path, gateway: EventServer) -> AsyncIterator[Outbox]:
    """What a reader fills from the gateway."""
    settings = GatewaySettings(target=f"127.0.0.1:{gateway.port}")
    async with outbox(tmp_path, 64 * 1024 * 1024) as opened:
        reading = asyncio.create_task(EventReader(settings, opened).run())
        await holds(opened, 0)
        yield opened
        await cancel([reading])


async def holds(kept: Outbox, sequence: int) -> None:
    """Waits until it has taken everything up to an event."""

    async def newest() -> int:
        position = kept.facts.position
        return -1 if position is None else position.sequence

    await eventually(newest, lambda now: now == sequence, f"it has taken event {sequence}")


async def lose(directory: Path, kept: Outbox) -> None:
    """Has one call fail at the disk, and the files removed before the next one: room is made in haste.

    After a failure the files are opened again.
    """
    (directory / CURSOR).unlink(missing_ok=True)
    (directory / CURSOR).mkdir()
    with contextlib.suppress(OutboxError):
        await kept.next_batch()
    for suffix in ("", "-wal", "-shm"):
        (directory / f"{NAME}{suffix}").unlink(missing_ok=True)
    (directory / CURSOR).rmdir()
    await kept.next_batch()


async def items_of(kept: Outbox) -> list[Item]:
    """Returns all that it holds, as a hub would get it."""
    found: list[Item] = []
    while batch := await kept.next_batch():
        found += batch.items
        await kept.delivered(batch, repeated=False)
    return found


async def test_what_it_had_is_announced(tmp_path: Path, gateway: EventServer, kept: Outbox) -> None:
    gateway.happen(100)
    await holds(kept, 100)
    await lose(tmp_path, kept)
    assert kept.facts.position is None
    gateway.happen(1)  # The stream of the gateway stands, and goes on after what is lost.
    await holds(kept, 101)
    gateway.happen(1)
    await holds(kept, 102)
    found = await items_of(kept)
    assert found[0].first == 1, "from the first event on all is there or announced"
    assert all(after.first == before.last + 1 for before, after in pairwise(found))
    assert isinstance(found[-1], Event)
