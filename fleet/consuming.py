"""A robot's commands: pull requests to a consumer, and what comes back, within one session."""

import asyncio
import json
import secrets
import time
from collections.abc import AsyncGenerator, Mapping
from contextlib import aclosing, asynccontextmanager
from dataclasses import dataclass
from typing import Final

from common.backoff import Backoff
from fleet.errors import HubError, HubReason
from fleet.incoming import DESCRIPTION
from fleet.replies import NO_RESPONDERS, Message, Waiter
from fleet.session import Session

_PULL_EXPIRES_S: Final = 20.0
"""A pull request waits this long at the hub for messages."""
_HEARTBEAT_S: Final = 2.0
"""The hub says this often that it still knows the pull request; two missing ones end it."""
_INACTIVE_S: Final = 60.0
"""The hub forgets a consumer of ours that is not read for this long."""
_MAX_BYTES: Final = 4 * 1024 * 1024
"""Bytes requested at once; more than any single message may have."""
_TIMEOUT_S: Final = 5.0
_FIRST_PAUSE_S: Final = 0.05
_LONGEST_PAUSE_S: Final = 0.5
_ACKNOWLEDGED_BY: Final = "$JS.ACK."
"""Beginning of the reply subjects that the hub gives to messages of a stream, and nothing else (ADR-15)."""
_SOON_S: Final = 1.0
"""A request without a message lasts longer, at an honest hub: until it expires."""
_KNOWN_WITHIN_S: Final = 3.0
"""From a pull request that no node could pass on until the consumer counts as unknown."""
_NANOSECONDS: Final = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Delivery:
    """A message of a stream.

    Attributes:
        subject: of the message.
        payload: of the message.
        headers: of the message.
        sequence: its place in the stream.
        consumer_sequence: its place among what this consumer was sent.
        deliveries: how often it was delivered, with this time.
        unix_s: when the stream took it, by the hub's clock.
        pending: messages still to come when it was sent.
    """

    subject: str
    payload: bytes
    headers: Mapping[str, str]
    sequence: int
    consumer_sequence: int
    deliveries: int
    unix_s: float
    pending: int
    _session: Session
    _reply: str

    async def ack(self, timeout_s: float = _TIMEOUT_S) -> None:
        """Acknowledges it, and returns when the hub knows.

        Raises:
            HubError: the hub may deliver it again.
        """
        await self._session.request(self._reply, b"+ACK", timeout_s)


async def pull(session: Session, stream: str, consumer: str, batch: int) -> AsyncGenerator[Delivery, None]:
    """Yields what a consumer delivers, until the session is lost.

    Raises:
        HubError: it is lost, or the consumer is.
    """
    backoff = Backoff(_FIRST_PAUSE_S, _LONGEST_PAUSE_S)
    async with _Puller.open(session, stream, consumer) as puller:
        while True:
            begin_s, empty = time.monotonic(), True
            async with aclosing(puller.request(batch, _PULL_EXPIRES_S)) as deliveries:
                async for delivery in deliveries:
                    empty = False
                    yield delivery
            if empty and time.monotonic() - begin_s < _SOON_S:
                # A hub that ends every request at once would keep this loop and the network busy.
                await asyncio.sleep(backoff.next_s())
            else:
                backoff.reset()


async def count(session: Session, stream: str, subjects: str, timeout_s: float) -> int:
    """Returns how many messages of a stream have such subjects: what a consumer would deliver.

    Raises:
        HubError: it can't be read.
    """
    name = secrets.token_hex(8)
    config = {
        "name": name,
        "ack_policy": "none",
        "deliver_policy": "all",
        "filter_subject": subjects,
        "inactive_threshold": int(_INACTIVE_S * _NANOSECONDS),
        "mem_storage": True,
        "num_replicas": 1,
    }
    call = f"$JS.API.CONSUMER.CREATE.{stream}.{name}.{subjects}"
    info = await session.api(call, {"stream_name": stream, "config": config}, timeout_s)
    await _forget(session, stream, name)
    pending = info.get("num_pending", 0)
    return pending if isinstance(pending, int) else 0


async def _forget(session: Session, stream: str, consumer: str) -> None:
    """Deletes a consumer; one that can't be deleted now, the hub forgets by itself."""
    if session.lost.done():
        return
    try:
        await session.publish(f"$JS.API.CONSUMER.DELETE.{stream}.{consumer}", b"")
    except HubError:
        return


class _Puller:
    """Pull requests to one consumer, one after the other."""

    def __init__(self, session: Session, stream: str, consumer: str, waiter: Waiter, reply: str) -> None:
        self._session = session
        self._consumer = consumer
        self._subject = _next_subject(stream, consumer)
        self._waiter = waiter
        self._inbox = reply
        self._requests = 0
        self._known = False
        """Whether the consumer has answered."""

    @classmethod
    @asynccontextmanager
    async def open(cls, session: Session, stream: str, consumer: str) -> AsyncGenerator["_Puller", None]:
        """Subscribes to what the consumer delivers, for the block.

        Raises:
            UnreachableError: the session is lost.
        """
        async with session.channel(_next_subject(stream, consumer)) as (waiter, reply):
            yield cls(session, stream, consumer, waiter, reply)

    async def request(self, batch: int, expires_s: float) -> AsyncGenerator[Delivery, None]:
        """Yields what answers one pull request; ends when it is complete or expires.

        Raises:
            HubError: the session is lost, or the consumer is.
        """
        heartbeat_s = min(_HEARTBEAT_S, expires_s / 3)
        request = {
            "batch": batch,
            "max_bytes": _MAX_BYTES,
            "expires": int(expires_s * _NANOSECONDS),
            "idle_heartbeat": int(heartbeat_s * _NANOSECONDS),
        }
        backoff, begin_s = Backoff(_FIRST_PAUSE_S, _LONGEST_PAUSE_S), time.monotonic()
        reply = await self._send(request)
        received = 0
        while received < batch:
            message = await self._waiter.get(2 * heartbeat_s + _TIMEOUT_S / 2)
            elapsed_s = time.monotonic() - begin_s
            if message.reply.startswith(_ACKNOWLEDGED_BY):
                # Of the stream: a status in its headers is its sender's, not the hub's.
                self._known = True
                received += 1
                yield delivery(self._session, message)
                continue
            if elapsed_s > expires_s + _TIMEOUT_S and self._waiter.replies.empty():
                return  # The hub goes on with what it should have ended.
            # A status of an earlier request, which was complete, may come late.
            if message.status and message.subject != reply:
                continue
            if message.status == NO_RESPONDERS and not self._known and elapsed_s < _KNOWN_WITHIN_S:
                # A node that has just started, or been joined, may not have heard of a new consumer yet.
                await asyncio.sleep(backoff.next_s())
                reply = await self._send(request)
                continue
            self._known = True
            if self._is_end(message):
                return

    async def _send(self, request: dict[str, int]) -> str:
        """Sends a pull request; returns the subject of its answers."""
        self._requests += 1
        reply = f"{self._inbox}.{self._requests}"
        await self._session.send(self._subject, json.dumps(request).encode(), reply)
        return reply

    def _is_end(self, message: Message) -> bool:
        """Whether a status ends the request, as opposed to a heartbeat.

        Raises:
            HubError: it says that the consumer can't be read.
        """
        description = message.headers.get(DESCRIPTION, "")
        match message.status:
            case "100":
                return False
            case "":
                raise HubError(HubReason.INVALID, "the hub answers a pull request with what is no status")
            case "404" | "408":
                return True
            case "409" if "batch completed" in description.lower() or "maxbytes" in description.lower():
                return True
            case status if status == NO_RESPONDERS:
                raise HubError(
                    HubReason.NO_RESPONDERS, f"the hub does not know the consumer {self._consumer}"
                )
            case "409":
                raise HubError(HubReason.MISSING, f"the consumer {self._consumer}: {description}")
            case status:
                raise HubError(HubReason.INVALID, f"the hub refuses to deliver: {status} {description}")


def _next_subject(stream: str, consumer: str) -> str:
    return f"$JS.API.CONSUMER.MSG.NEXT.{stream}.{consumer}"


def delivery(session: Session, message: Message) -> Delivery:
    """Reads what JetStream says of a message in its reply subject (ADR-15, with and without a domain).

    Raises:
        HubError: it says nothing that can be understood.
    """
    parts = message.reply.split(".")
    first = 4 if len(parts) == 9 else 6
    try:
        numbers = [int(part) for part in parts[first : first + 5]]
        deliveries, sequence, consumer_sequence, unix_ns, pending = numbers
        taken_s = unix_ns / _NANOSECONDS
    # A number of more digits than a float has is an OverflowError.
    except (ValueError, OverflowError) as error:
        raise HubError(HubReason.INVALID, "a delivery has no place in its stream") from error
    return Delivery(
        subject=message.subject,
        payload=message.payload,
        headers=message.headers,
        sequence=sequence,
        consumer_sequence=consumer_sequence,
        deliveries=deliveries,
        unix_s=taken_s,
        pending=pending,
        _session=session,
        _reply=message.reply,
    )
