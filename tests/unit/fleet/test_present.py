"""Reading what is in a stream now, of a hub that has too much, or never comes to an end."""

import json
from collections.abc import Iterator
from contextlib import aclosing, contextmanager
from typing import Any

import pytest

from fleet import present as module
from fleet.connection import FleetAddress, Hub
from fleet.errors import HubError, HubReason
from fleet.present import present
from fleet.replies import Message, Waiter

_TAKEN = "2026-01-31T12:00:00.123456789Z"


class Answering:
    """A session whose hub sends whatever a test has it send.

    Args:
        announced: how many messages the hub says that there are.
        endless: whether it says after each one that more follow than it has sent.
        size: of each, in bytes.

    Attributes:
        sent: how many it has sent.
        read: how many of them were passed on.
        filters: of the requests.
    """

    def __init__(self, announced: int, *, endless: bool = False, size: int = 1) -> None:
        self._announced, self._endless, self._size = announced, endless, size
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
        for _ in range(request["batch"]):
            if self.sent == self._announced and not self._endless:
                break
            self.sent += 1
            pending = self.sent + 1 if self._endless else self._announced - self.sent
            counts = {"Nats-Num-Pending": str(pending), "Nats-Last-Sequence": str(previous)}
            self._waiter.take(_message(f"$KV.b.r{self.sent}", self.sent, b"x" * self._size, counts))
            previous = self.sent
        self._waiter.take(_status("204" if previous else "404"))


class Older:
    """A session whose hub is older than 2.11: one message for a request, and nothing of those to come.

    Args:
        keys: how many there are.
        changing: how many of them change with each request.
        size: of each, in bytes.
        account: whose the call for the subjects is.

    Attributes:
        requests: so far.
        read: how many messages were passed on.
        filters: by which subjects were asked for.
    """

    def __init__(self, keys: int, *, changing: int = 0, size: int = 1, account: str = "people") -> None:
        self._changing, self._size = changing, size
        self._info = {"people": "fleet.info.KV_b", "fleet": "$JS.API.STREAM.INFO.KV_b"}[account]
        self._places = {f"$KV.b.r{number}": number for number in range(1, keys + 1)}
        self._newest = keys
        self.requests = self.read = 0
        self.filters: list[str] = []
        self.answer: dict[str, Any] = {}

    @contextmanager
    def waiter(self, subject: str) -> Iterator[tuple[Waiter, str]]:
        self._waiter = Waiter(subject)
        yield self._waiter, "_INBOX.x"

    async def send(self, _subject: str, payload: bytes, _reply: str) -> None:
        request = json.loads(payload)
        found = [
            (place, subject)
            for subject, place in self._places.items()
            if request.get("last_by_subj", subject) == subject and place >= request.get("seq", 0)
        ]
        if found:
            self._waiter.take(_message(min(found)[1], min(found)[0], b"x" * self._size, {}))
        else:
            self._waiter.take(_status("404"))
        self._change()

    async def api(self, subject: str, request: Any, _timeout_s: float) -> dict[str, Any]:
        if subject != self._info:
            raise HubError(HubReason.NO_RESPONDERS, f"nothing at the hub takes {subject}")
        self.filters.append(request["subjects_filter"])
        answer = self.answer or {"state": {"subjects": dict.fromkeys(self._places, 1)}}
        self._change()
        return answer

    def _change(self) -> None:
        self.requests += 1
        for subject in list(self._places)[: self._changing]:
            self._newest += 1
            self._places[subject] = self._newest
            self._places[subject] = self._places.pop(subject)


def _message(subject: str, sequence: int, content: bytes, counts: dict[str, str]) -> Message:
    place = {"Nats-Subject": subject, "Nats-Sequence": str(sequence), "Nats-Time-Stamp": _TAKEN}
    return Message("_INBOX.x", content, place | counts, "")


def _status(code: str) -> Message:
    return Message("_INBOX.x", b"", {"Status": code}, "")


async def read(session: Answering | Older) -> int:
    """Reads all; returns how many there were."""
    hub: Any = session
    async with aclosing(present(hub, "KV_b", "$KV.b.>", 1)) as messages:
        async for _ in messages:
            session.read += 1
    return session.read


@pytest.fixture(autouse=True)
def bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_PRESENT", 1000)
    monkeypatch.setattr(module, "MOST_PRESENT_BYTES", 100_000)


@pytest.mark.parametrize("kind", [Answering, Older])
@pytest.mark.parametrize("number", [0, 1, 255, 256, 257, 1000])
async def test_as_many_as_permitted_are_read(number: int, kind: type[Answering | Older]) -> None:
    assert await read(kind(number)) == number


@pytest.mark.parametrize("kind", [Answering, Older])
async def test_more_are_refused_before_the_first_is_read(kind: type[Answering | Older]) -> None:
    session = kind(1001)
    with pytest.raises(HubError, match="more than the 1000 messages that are read at once") as refused:
        await read(session)
    assert refused.value.reason is HubReason.TOO_MANY
    assert (session.read, len(session.filters)) == (0, 1)


async def test_a_hub_that_never_comes_to_an_end_is_left() -> None:
    session = Answering(1, endless=True)
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


async def test_bytes_of_an_older_hub_are_bounded_too() -> None:
    session = Older(1000, size=1000)
    with pytest.raises(HubError, match="more than the 100000 bytes that are read at once"):
        await read(session)
    assert session.read == 100


@pytest.mark.parametrize("account", ["people", "fleet"])
async def test_an_older_hub_is_read_while_more_changes_than_is_read(account: str) -> None:
    """The defect: the newest message came no nearer, until 100 000 had been read."""
    session: Any = Older(50, changing=3, account=account)
    hub = Hub(FleetAddress(()))
    hub._session = session
    assert set(await hub.entries("b")) == {f"r{number}" for number in range(1, 51)}
    assert session.requests == 1 + 1 + 50


@pytest.mark.parametrize(
    "answer",
    [
        {"state": None},
        {"state": {"subjects": ["$KV.b.r1"]}},
        {"state": {"subjects": 1}},
        {"other": {}},
    ],
)
async def test_an_older_hub_that_lists_nothing_sensible_is_an_error(answer: dict[str, Any]) -> None:
    session = Older(3)
    session.answer = answer
    with pytest.raises(HubError) as refused:
        await read(session)
    assert refused.value.reason is HubReason.INVALID


@pytest.mark.parametrize("kind", [Answering, Older])
@pytest.mark.parametrize("keys", [">", "r1.>"])
async def test_a_part_of_a_bucket_is_asked_for_at_the_hub(keys: str, kind: type[Answering | Older]) -> None:
    session: Any = kind(3)
    hub = Hub(FleetAddress(()))
    hub._session = session
    assert sorted(await hub.entries("b", keys)) == ["r1", "r2", "r3"]
    assert session.filters == [f"$KV.b.{keys}"]
