"""Reading what is in a stream now, of a hub that has too much, or never comes to an end."""

import json
from collections.abc import AsyncIterator
from contextlib import aclosing, asynccontextmanager
from types import SimpleNamespace
from typing import Any

import pytest

from fleet import consuming
from fleet.connection import FleetAddress, Hub
from fleet.consuming import Start, present
from fleet.errors import HubError, HubReason
from fleet.replies import Message, Waiter


class Answering:
    """A session whose hub sends whatever a test has it send.

    Args:
        announced: how many messages the hub says that there are.
        endless: whether it says after each one that more follow than it has sent.
        size: of each, in bytes.

    Attributes:
        sent: how many it has sent.
        filters: of the consumers that were made.
        forgotten: how many consumers were deleted.
    """

    def __init__(self, announced: int, *, endless: bool = False, size: int = 1) -> None:
        self._announced, self._endless, self._size = announced, endless, size
        self.lost = SimpleNamespace(done=lambda: False)
        self.sent = 0
        self.filters: list[str] = []
        self.forgotten = 0

    async def api(self, _call: str, request: Any, _timeout_s: float) -> dict[str, Any]:
        self.filters.append(request["config"]["filter_subject"])
        return {"num_pending": self._announced}

    @asynccontextmanager
    async def channel(self, subject: str) -> AsyncIterator[tuple[Waiter, str]]:
        self._waiter = Waiter(subject)
        yield self._waiter, "_INBOX.x"

    async def send(self, _subject: str, payload: bytes, _reply: str) -> None:
        for _ in range(_batch(payload)):
            self.sent += 1
            pending = self.sent + 1 if self._endless else self._announced - self.sent
            place = f"$JS.ACK.KV_b.c.1.{self.sent}.{self.sent}.1700000000000000000.{pending}"
            self._waiter.take(Message(f"$KV.b.r{self.sent}", b"x" * self._size, {}, place))

    async def publish(self, _subject: str, _payload: bytes) -> None:
        self.forgotten += 1


def _batch(payload: bytes) -> int:

    return int(json.loads(payload)["batch"])


async def read(session: Answering) -> int:
    """Reads all; returns how many there were."""
    hub: Any = session
    count = 0
    async with aclosing(present(hub, "KV_b", "$KV.b.>", Start.last_per_subject(), 1)) as deliveries:
        async for _ in deliveries:
            count += 1
    return count


@pytest.fixture(autouse=True)
def bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(consuming, "MOST_PRESENT", 1000)
    monkeypatch.setattr(consuming, "MOST_PRESENT_BYTES", 100_000)


async def test_as_many_as_permitted_are_read() -> None:
    session = Answering(1000)
    assert await read(session) == 1000
    assert session.forgotten == 1


async def test_more_are_refused_before_the_first_is_read() -> None:
    session = Answering(1001)
    with pytest.raises(HubError, match="1001 messages, more than the 1000 that are read at once") as refused:
        await read(session)
    assert refused.value.reason is HubReason.TOO_MANY
    assert (session.sent, session.forgotten) == (0, 1)


async def test_a_hub_that_never_comes_to_an_end_is_left() -> None:
    session = Answering(1, endless=True)
    with pytest.raises(HubError, match="more than the 1000 messages that are read at once") as refused:
        await read(session)
    assert refused.value.reason is HubReason.TOO_MANY
    assert session.sent <= 1000 + 256
    assert session.forgotten == 1


async def test_bytes_are_bounded_too() -> None:
    session = Answering(1000, size=1000)
    with pytest.raises(HubError, match="more than the 100000 bytes that are read at once") as refused:
        await read(session)
    assert refused.value.reason is HubReason.TOO_MANY
    assert session.sent <= 256


@pytest.mark.parametrize("keys", [">", "r1.>"])
async def test_a_part_of_a_bucket_is_asked_for_at_the_hub(keys: str) -> None:
    session: Any = Answering(3)
    hub = Hub(FleetAddress(()))
    hub._session = session
    assert sorted(await hub.entries("b", keys)) == ["r1", "r2", "r3"]
    assert session.filters == [f"$KV.b.{keys}"]
