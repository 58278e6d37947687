"""When a batch that the hub did not take is sent again, and what becomes of one that the disk has changed."""

import asyncio
import sqlite3
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from bridge.connection.sender import Sender
from bridge.events.values import Batch, Event, Position
from bridge.outbox.database import NAME, Facts
from bridge.outbox.outbox import outbox
from common.broadcast import Broadcast
from common.tasks import cancel
from fleet.connection import FleetAddress, Hub, Published
from fleet.errors import HubError, HubReason
from omniseer.fleet.v1.event_pb2 import DROP_REASON_OUTBOX_LOST, EventBatch
from omniseer.gateway.v1 import event_pb2
from tests.support.eventually import eventually
from tests.support.virtual_time import in_virtual_time


def event(sequence: int) -> Event:
    message = event_pb2.Event(run_id="run", sequence=sequence, message=f"event {sequence}")
    return Event("run", sequence, 1, message.SerializeToString())


class Outbox:
    """Has one batch until it is delivered."""

    results = 0

    def __init__(self) -> None:
        self.batch: Batch | None = Batch((event(1),), 1, 1)
        self.changes = Broadcast()

    @property
    def facts(self) -> Any:
        return SimpleNamespace(batch=self.batch)

    async def next_batch(self) -> Batch | None:
        return self.batch

    async def next_result(self) -> Any:
        return None

    async def delivered(self, batch: Batch, *, repeated: bool) -> None:
        assert (batch, repeated) == (self.batch, False)
        self.batch = None
        self.changes.notify_all()


class Silent(Hub):
    """A hub whose first server takes nothing, and whose second one everything.

    Attributes:
        attempts: when something was published.
    """

    def __init__(self) -> None:
        super().__init__(FleetAddress(()))
        self.attempts: list[float] = []

    def connect(self, server: str) -> None:
        self._set(connected=True, server=server, error=None)

    async def publish_once(self, subject: str, payload: bytes, timeout_s: float = 5.0) -> Published:
        self.attempts.append(asyncio.get_running_loop().time())
        if self.link.connections == 1:
            raise HubError(HubReason.TIMEOUT, f"no answer about {subject} ({len(payload)}) in {timeout_s} s")
        return Published.DELIVERED


@in_virtual_time
async def test_it_is_sent_again_as_soon_as_there_is_another_connection() -> None:
    """The defect: it waited for the end of a pause that had grown while the server was silent."""
    hub, outbox = Silent(), Outbox()
    kept: Any = outbox
    sending = asyncio.create_task(Sender("lab2", kept, hub).run())
    hub.connect("a")
    await asyncio.sleep(40.0)
    assert 6 <= len(hub.attempts) <= 7, "with pauses that grow"
    hub.connect("b")
    await asyncio.sleep(0.01)
    assert outbox.batch is None
    assert hub.attempts[-1] == 40.0
    await cancel([sending])


class Results(Outbox):
    """Has no batch, and the result of a command until it is sent."""

    def __init__(self) -> None:
        super().__init__()
        self.batch = None
        self.result: tuple[str, bytes] | None = ("c1", b"done")

    async def next_result(self) -> Any:
        return self.result

    async def result_sent(self, _command_id: str) -> None:
        self.result = None
        self.changes.notify_all()


@in_virtual_time
async def test_what_is_said_of_a_result_that_was_not_taken_ends_when_it_is() -> None:
    """The defect: it stayed in the robot's status until the next event, hours perhaps."""
    hub, outbox = Silent(), Results()
    kept: Any = outbox
    sender = Sender("lab2", kept, hub)
    sending = asyncio.create_task(sender.run())
    hub.connect("a")
    await asyncio.sleep(1.0)
    assert "no answer about fleet.lab2.res.c1" in sender.error
    hub.connect("b")
    await asyncio.sleep(0.01)
    assert outbox.result is None
    assert sender.error == ""
    await cancel([sending])


class Taking(Hub):
    """A hub that takes everything; `batches` is what it has."""

    def __init__(self) -> None:
        super().__init__(FleetAddress(()))
        self._set(connected=True, server="a", error=None)
        self.batches: list[EventBatch] = []

    async def publish_once(self, subject: str, payload: bytes, timeout_s: float = 5.0) -> Published:  # noqa: ARG002
        self.batches.append(EventBatch.FromString(payload))
        return Published.DELIVERED


async def all_sent(directory: Path, changed: str, value: object) -> tuple[list[EventBatch], Facts]:
    """Returns what a hub gets of three events, of which a bad disk has changed the second one, and facts."""
    async with outbox(directory, 64 << 20) as kept:
        await kept.position()
        await kept.append([event(1), event(2), event(3)], None, Position("run", 3))
    with closing(sqlite3.connect(directory / NAME)) as database:
        database.execute(f"UPDATE items SET {changed} = ? WHERE first = 2", (value,))  # noqa: S608  # the test's own
        database.commit()
    hub = Taking()

    async with outbox(directory, 64 << 20) as kept:
        await kept.position()
        sending = asyncio.create_task(Sender("lab2", kept, hub).run())

        async def waiting() -> int:
            return kept.facts.events

        await eventually(waiting, lambda count: count == 0 or sending.done(), "all is sent")
        await cancel([sending])
        return hub.batches, kept.facts


@pytest.mark.parametrize("changed", [b"\xff\xff", event(7).payload], ids=["no message", "another one's"])
async def test_an_event_that_the_disk_has_changed_becomes_a_gap(tmp_path: Path, changed: bytes) -> None:
    """The defect: the database is whole, and the bridge ended at this event, and again at each start."""
    (batch,), facts = await all_sent(tmp_path, "payload", changed)
    first, gap, last = batch.items
    assert (first.event.sequence, last.event.sequence) == (1, 3)
    assert (gap.dropped.first_sequence, gap.dropped.last_sequence) == (2, 2)
    assert gap.dropped.reason == DROP_REASON_OUTBOX_LOST
    assert gap.dropped.worst_severity == 1
    assert (facts.events, facts.sent, facts.dropped) == (0, 2, 1)
