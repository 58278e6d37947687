"""What a hub may answer to a direct get, and where in a stream a time is."""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import aclosing, contextmanager
from types import MappingProxyType
from typing import Any

import pytest

from fleet import direct
from fleet.direct import Start, StoredMessage, follow, last
from fleet.errors import HubError, HubReason
from fleet.replies import Message, Waiter


def _message(
    sequence: int, previous: int = 0, pending: int | None = 1, more: Mapping[str, str] = MappingProxyType({})
) -> Message:
    place = {
        "Nats-Subject": "fleet.r1.ev.run.1",
        "Nats-Sequence": str(sequence),
        "Nats-Time-Stamp": f"1970-01-01T00:{sequence // 60:02}:{sequence % 60:02}Z",
    }
    if pending is not None:
        place |= {"Nats-Num-Pending": str(pending), "Nats-Last-Sequence": str(previous)}
    return Message("_INBOX.x", b"event", place | dict(more), "")


def _status(code: str) -> Message:
    return Message("_INBOX.x", b"", {"Status": code, "Description": "so it is"}, "")


class Saying:
    """A session whose hub says one thing after the other, each to one request.

    Args:
        said: to each request.
    """

    def __init__(self, said: Sequence[Sequence[Message]]) -> None:
        self._said = iter(said)

    @contextmanager
    def waiter(self, subject: str) -> Iterator[tuple[Waiter, str]]:
        self._waiter = Waiter(subject)
        yield self._waiter, "_INBOX.x"

    async def send(self, _subject: str, _payload: bytes, _reply: str) -> None:
        for message in next(self._said):
            self._waiter.take(message)


async def _read(session: Any, count: int) -> list[int]:
    """Follows until there are so many; returns their sequences."""
    found: list[int] = []
    async with aclosing(follow(session, "s", ">", Start.all(), 0.1)) as messages:
        async for message in messages:
            found.append(message.sequence)
            if len(found) == count:
                break
    return found


async def test_the_next_request_is_for_what_did_not_come() -> None:
    cut = [_message(1), _message(2, 1), _status("204")]
    assert await _read(Saying([cut, [_status("404")], [_message(4)]]), 3) == [1, 2, 4]


@pytest.mark.parametrize("status", ["503", "404", "204", "408"])
async def test_a_status_of_the_sender_is_none_of_the_hubs(status: str) -> None:
    """The defect: 503 had the request sent again, and its answers were mixed with those of the first."""
    first, second = _message(1, more={"Status": status}), _message(2, 1, 0)
    assert await _read(Saying([[first, second, _status("204")]]), 2) == [1, 2]


@pytest.mark.parametrize(
    ("said", "reason"),
    [
        ([_message(1), _message(3, 2)], HubReason.INVALID),
        ([_message(1), _message(1, 1)], HubReason.INVALID),
        ([_message(1), _message(0, 1)], HubReason.INVALID),
        ([_message(1, more={"Nats-Sequence": "9" * 5000})], HubReason.INVALID),
        ([_message(1, more={"Nats-Sequence": "x"})], HubReason.INVALID),
        ([_message(1, more={"Nats-Num-Pending": ""})], HubReason.INVALID),
        ([_message(1, more={"Nats-Time-Stamp": "yesterday"})], HubReason.INVALID),
        ([Message("_INBOX.x", b"event", {}, "")], HubReason.INVALID),
        ([_status("408")], HubReason.INVALID),
        ([_message(1), _status("500")], HubReason.INVALID),
        ([_message(1)], HubReason.TIMEOUT),
        ([], HubReason.TIMEOUT),
    ],
)
async def test_an_answer_without_sense_is_an_error(said: list[Message], reason: HubReason) -> None:
    with pytest.raises(HubError) as error:
        await _read(Saying([said]), 2)
    assert error.value.reason is reason


async def test_a_stream_that_a_node_has_not_heard_of_yet_is_waited_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(direct, "_KNOWN_WITHIN_S", 60.0)
    unknown = [_status("503")]
    assert await _read(Saying([unknown, unknown, [_message(1)]]), 1) == [1]


async def test_but_not_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(direct, "_KNOWN_WITHIN_S", 0.0)
    with pytest.raises(HubError) as error:
        await _read(Saying([[_status("503")]]), 1)
    assert error.value.reason is HubReason.NO_RESPONDERS


class Stream:
    """A session whose hub has a stream with these messages; each was taken in the second of its sequence.

    Args:
        sequences: of the messages.
    """

    def __init__(self, sequences: list[int]) -> None:
        self._sequences = sequences
        self.requests = 0

    @contextmanager
    def waiter(self, subject: str) -> Iterator[tuple[Waiter, str]]:
        self._waiter = Waiter(subject)
        yield self._waiter, "_INBOX.x"

    async def send(self, _subject: str, payload: bytes, _reply: str) -> None:
        self.requests += 1
        request = json.loads(payload)
        found = [each for each in self._sequences if each >= request.get("seq", 0)]
        if not found:
            self._waiter.take(_status("404"))
            return
        sequence = found[-1] if "last_by_subj" in request else found[0]
        self._waiter.take(_message(sequence, pending=None))  # as without a batch


@pytest.mark.parametrize("second", [0, 1, 2, 5, 6, 7, 30, 31, 40])
@pytest.mark.parametrize("sequences", [[1], [2, 3, 5, 6, 30], list(range(1, 41)), [40]])
async def test_a_time_is_found_in_a_stream(sequences: list[int], second: int) -> None:
    stream: Any = Stream(sequences)
    expected = [each for each in sequences if each >= second]
    async with aclosing(follow(stream, "s", ">", Start.at(float(second)), 1)) as messages:
        found = [(await anext(messages)).sequence for _ in expected]
    assert found == expected
    assert stream.requests <= 2 * len(expected) + 8


async def test_the_last_message_of_none_is_none() -> None:
    stream: Any = Stream([])
    assert await last(stream, "s", ">", 1) is None
    stream = Stream([3, 7])
    newest = await last(stream, "s", ">", 1)
    assert isinstance(newest, StoredMessage)
    assert (newest.sequence, newest.pending, newest.unix_s) == (7, None, 7.0)
