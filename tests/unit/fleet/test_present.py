"""Reading what is in a stream now, of a hub that has too much, or never comes to an end."""

import json
from collections.abc import Iterator
from contextlib import aclosing, contextmanager
from typing import Any

import pytest

from fleet import direct
from fleet.connection import FleetAddress, Hub
from fleet.direct import present
from fleet.errors import HubError, HubReason
from fleet.replies import Message, Waiter

_TAKEN = "2026-01-31T12:00:00.123456789Z"


class Answering:
    """A session whose hub sends whatever a test has it send.

    Args:
        announced: how many messages the hub says that there are.
        endless: whether it says after each one that more follow than it has sent.
        size: of each, in bytes.
        old: whether it is older than 2.11: one message for a request, and nothing of those to come.

    Attributes:
        sent: how many it has sent.
        read: how many of them were passed on.
        filters: of the requests.
    """

    def __init__(self, announced: int, *, endless: bool = False, size: int = 1, old: bool = False) -> None:
        self._announced, self._endless, self._size, self._old = announced, endless, size, old
        self.sent = self.read = 0
        self.filters: list[str] = []

    @contextmanager
    def waiter(self, subject: str) -> Iterator[tuple[Waiter, str]]:
        self._waiter = Waiter(subject)
        yield self._waiter, "_INBOX.x"

    async def send(self, _subject: str, payload: bytes, _reply: str) -> None:
        request = json.loads(payload)
        self.filters.append(request["next_by_subj"])
        assert request["seq"] == self.sent + 1
        previous = 0
        for _ in range(1 if self._old else request["batch"]):
            if self.sent == self._announced and not self._endless:
                break
            self.sent += 1
            self._waiter.take(self._message(previous))
            previous = self.sent
        if not self._old or self.sent == self._announced:
            status = "204" if previous else "404"
            self._waiter.take(Message("_INBOX.x", b"", {"Status": status}, ""))

    def _message(self, previous: int) -> Message:
        place = {"Nats-Subject": f"$KV.b.r{self.sent}", "Nats-Sequence": str(self.sent)}
        if not self._old:
            pending = self.sent + 1 if self._endless else self._announced - self.sent
            place |= {"Nats-Num-Pending": str(pending), "Nats-Last-Sequence": str(previous)}
        return Message("_INBOX.x", b"x" * self._size, place | {"Nats-Time-Stamp": _TAKEN}, "")


async def read(session: Answering) -> int:
    """Reads all; returns how many there were."""
    hub: Any = session
    async with aclosing(present(hub, "KV_b", "$KV.b.>", 1)) as messages:
        async for _ in messages:
            session.read += 1
    return session.read


@pytest.fixture(autouse=True)
def bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(direct, "MOST_PRESENT", 1000)
    monkeypatch.setattr(direct, "MOST_PRESENT_BYTES", 100_000)


@pytest.mark.parametrize("old", [False, True])
@pytest.mark.parametrize("number", [0, 1, 255, 256, 257, 1000])
async def test_as_many_as_permitted_are_read(number: int, old: bool) -> None:
    assert await read(Answering(number, old=old)) == number


async def test_more_are_refused_before_the_first_is_read() -> None:
    session = Answering(1001)
    with pytest.raises(HubError, match="more than the 1000 messages that are read at once") as refused:
        await read(session)
    assert refused.value.reason is HubReason.TOO_MANY
    assert (session.read, len(session.filters)) == (0, 1)


@pytest.mark.parametrize("old", [False, True])
async def test_a_hub_that_never_comes_to_an_end_is_left(old: bool) -> None:
    session = Answering(1, endless=True, old=old)
    with pytest.raises(HubError, match="more than the 1000 messages that are read at once") as refused:
        await read(session)
    assert refused.value.reason is HubReason.TOO_MANY
    assert session.sent <= 1000 + 256


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
