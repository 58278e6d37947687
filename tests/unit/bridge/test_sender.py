"""When a batch that the hub did not take is sent again."""

import asyncio
from types import SimpleNamespace
from typing import Any

from bridge.sender import Sender
from bridge.values import Batch, Event
from common.broadcast import Broadcast
from common.tasks import cancel
from fleet.connection import FleetAddress, Hub, Published
from fleet.errors import HubError, HubReason
from tests.support.virtual_time import in_virtual_time


class Outbox:
    """Has one batch until it is delivered."""

    results = 0

    def __init__(self) -> None:
        self.batch: Batch | None = Batch((Event("run", 1, 1, b""),), 1, 1)
        self.changes = Broadcast()

    @property
    def facts(self) -> Any:
        return SimpleNamespace(batch=self.batch)

    async def next_batch(self) -> Batch | None:
        return self.batch

    async def next_result(self) -> None:
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
