"""Reading streams by direct gets (ADR-31): a request and its answers, without a consumer.

A program that may make a consumer decides where in the account of the streams it publishes, and so can put
messages in the place of others. Answers go to the account that has asked (docs/decisions/0017).

| what happens | what follows |
|---|---|
| the hub is older than 2.11 | one message for each request: slower, and the same messages |
| a message of an answer is lost on its way | HubError; `follow` goes on after the last one that came |
| a node lags behind the others | what is newest comes with a later request; nothing is left out |
| the hub repeats messages, or goes back | HubError |
"""

import asyncio
import json
import time
from collections.abc import AsyncGenerator, Mapping
from contextlib import aclosing
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final, Self

from common.backoff import Backoff
from fleet import names
from fleet.errors import HubError, HubReason
from fleet.incoming import DESCRIPTION, PENDING, PREVIOUS, SEQUENCE, STORED_AS, TAKEN
from fleet.replies import NO_RESPONDERS, Message
from fleet.session import Session

_BATCH: Final = 256
"""Messages requested at once."""
_MAX_BYTES: Final = 2 * 1024 * 1024
"""Bytes requested at once; more than any single message may have, and less than may wait for a reader."""
_FIRST_POLL_S: Final = 0.1
_LONGEST_POLL_S: Final = 1.0
"""Between two requests for what is new, while there is nothing."""
_FIRST_PAUSE_S: Final = 0.05
_LONGEST_PAUSE_S: Final = 0.5
_KNOWN_WITHIN_S: Final = 3.0
"""From a request that no node could pass on until the stream counts as missing."""
_MOST_STEPS: Final = 64
"""To find a time in a stream: sequences have 64 bits."""


@dataclass(frozen=True, slots=True)
class Start:
    """Where in a stream to begin.

    Attributes:
        sequence: with the first message that has this sequence or a later one.
        unix_s: and that the stream took at or after this time, by the hub's clock.
    """

    sequence: int = 1
    unix_s: float | None = None

    @classmethod
    def all(cls) -> Self:
        """With the oldest message."""
        return cls()

    @classmethod
    def after(cls, sequence: int) -> Self:
        """With the first message after that of this sequence."""
        return cls(sequence + 1)

    @classmethod
    def at(cls, unix_s: float) -> Self:
        """With the first message that the stream took at or after this time."""
        return cls(unix_s=unix_s)


@dataclass(frozen=True, slots=True)
class StoredMessage:
    """A message of a stream.

    Attributes:
        subject: of the message.
        payload: of the message.
        headers: of the message.
        sequence: its place in the stream.
        unix_s: when the stream took it, by the hub's clock.
        pending: messages still to come when it was sent; None: the hub does not say (before 2.11).
    """

    subject: str
    payload: bytes
    headers: Mapping[str, str]
    sequence: int
    unix_s: float
    pending: int | None


async def follow(
    session: Session, stream: str, subjects: str, start: Start, timeout_s: float
) -> AsyncGenerator[StoredMessage, None]:
    """Yields a stream's messages in order, the present ones and then each that comes.

    Raises:
        HubError: the session is lost, or the hub does not answer: begin again after the last message.
    """
    sequence = await _first_sequence(session, stream, subjects, start, timeout_s)
    pause = Backoff(_FIRST_POLL_S, _LONGEST_POLL_S)
    while True:
        before = sequence
        async with aclosing(batch(session, stream, subjects, sequence, timeout_s)) as messages:
            async for message in messages:
                sequence = message.sequence + 1
                yield message
        if sequence == before:
            await asyncio.sleep(pause.next_s())
        else:
            pause.reset()


async def stream_info(session: Session, stream: str, request: Any, timeout_s: float) -> dict[str, Any]:
    """Returns JetStream's StreamInfo of a stream.

    Args:
        session: with the hub.
        stream: its name.
        request: what of it, beyond the least (None).
        timeout_s: for each answer of the hub.

    Raises:
        HubError: with JetStream's code.
    """
    try:
        return await session.api(names.info_subject(stream), request, timeout_s)
    except HubError as error:
        if error.reason is not HubReason.NO_RESPONDERS:
            raise
    # The name is that of people's accounts. Where the streams are, the call has its own.
    return await session.api(f"$JS.API.STREAM.INFO.{stream}", request, timeout_s)


async def batch(
    session: Session, stream: str, subjects: str, sequence: int, timeout_s: float
) -> AsyncGenerator[StoredMessage, None]:
    """Yields the next messages of a stream from a sequence on; none if there are none yet.

    Raises:
        HubError: the hub does not answer, or with what does not follow one another.
    """
    request = {"seq": sequence, "next_by_subj": subjects, "batch": _BATCH, "max_bytes": _MAX_BYTES}
    async with aclosing(_answers(session, stream, request, timeout_s)) as messages:
        async for message in messages:
            if message.sequence < sequence:
                raise HubError(HubReason.INVALID, f"the hub repeats messages of {stream}")
            sequence = message.sequence + 1
            yield message


async def last(session: Session, stream: str, subjects: str, timeout_s: float) -> StoredMessage | None:
    """Returns the newest message of a stream with such a subject; None if there is none.

    Raises:
        HubError: it can't be read.
    """
    return await _one(session, stream, {"last_by_subj": subjects}, timeout_s)


async def _first_sequence(
    session: Session, stream: str, subjects: str, start: Start, timeout_s: float
) -> int:
    """Returns from which sequence on there is nothing before a start; by halves, which all servers know."""
    newest = None if start.unix_s is None else await last(session, stream, subjects, timeout_s)
    if start.unix_s is None or newest is None:
        return start.sequence
    if newest.unix_s < start.unix_s:
        return max(start.sequence, newest.sequence + 1)
    low, high = start.sequence, newest.sequence
    for _ in range(_MOST_STEPS):
        if low >= high:
            break
        middle = (low + high) // 2
        found = await _one(session, stream, {"seq": middle, "next_by_subj": subjects}, timeout_s)
        if found is None or found.unix_s >= start.unix_s:
            high = middle
        else:
            low = found.sequence + 1
    return low


async def _one(
    session: Session, stream: str, request: Mapping[str, Any], timeout_s: float
) -> StoredMessage | None:
    async with aclosing(_answers(session, stream, request, timeout_s)) as messages:
        return await anext(messages, None)


async def _answers(
    session: Session, stream: str, request: Mapping[str, Any], timeout_s: float
) -> AsyncGenerator[StoredMessage, None]:
    """Yields what answers one direct get, at most _BATCH messages."""
    subject, payload = f"$JS.API.DIRECT.GET.{stream}", json.dumps(request).encode()
    with session.waiter(subject) as (waiter, reply):
        backoff, begin_s = Backoff(_FIRST_PAUSE_S, _LONGEST_PAUSE_S), time.monotonic()
        await session.send(subject, payload, reply)
        message = await waiter.get(timeout_s)
        while message.status == NO_RESPONDERS and time.monotonic() - begin_s < _KNOWN_WITHIN_S:
            # A node that has just started, or been joined, may not have heard yet of who has the stream.
            await asyncio.sleep(backoff.next_s())
            await session.send(subject, payload, reply)
            message = await waiter.get(timeout_s)
        previous = 0
        for number in range(1, _BATCH + 1):
            if SEQUENCE not in message.headers:
                _check_end(stream, message)
                return
            stored = _stored(message)
            if stored.pending is not None and _number(message, PREVIOUS) != previous:
                raise HubError(HubReason.INVALID, "messages were lost on their way")
            previous = stored.sequence
            yield stored
            if stored.pending is None or number == _BATCH:
                return
            message = await waiter.get(timeout_s)


def _check_end(stream: str, message: Message) -> None:
    """Checks that a status means that there is no more.

    Raises:
        HubError: it means anything else.
    """
    match message.status:
        case "204" | "404":
            return
        case status if status == NO_RESPONDERS:
            raise HubError(HubReason.NO_RESPONDERS, f"nothing at the hub answers for the stream {stream}")
        case "":
            raise HubError(HubReason.INVALID, f"the hub answers without a place in {stream}")
        case status:
            text = f"the hub refuses to read {stream}: {status} {message.headers.get(DESCRIPTION, '')}"
            raise HubError(HubReason.INVALID, text)


def _stored(message: Message) -> StoredMessage:
    """Reads what the hub says of a message.

    Raises:
        HubError: it says nothing that can be understood.
    """
    try:
        taken_s = datetime.fromisoformat(message.headers[TAKEN]).timestamp()
    except (KeyError, ValueError, OverflowError) as error:
        raise HubError(HubReason.INVALID, "the hub does not say when it took a message") from error
    return StoredMessage(
        subject=message.headers.get(STORED_AS, ""),
        payload=message.payload,
        headers=message.headers,
        sequence=_number(message, SEQUENCE),
        unix_s=taken_s,
        pending=_number(message, PENDING) if PENDING in message.headers else None,
    )


def _number(message: Message, header: str) -> int:
    try:
        return int(message.headers.get(header, ""))
    # More digits than are converted at all are a ValueError, too.
    except ValueError as error:
        raise HubError(HubReason.INVALID, "a message has no place in its stream") from error
