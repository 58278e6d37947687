"""What a hostile server of the hub can make a connection cost: bounded, and the next server is tried."""

import asyncio
import time
from contextlib import aclosing

import pytest

from common.tasks import cancel
from fleet.connection import FleetAddress, connect
from fleet.consuming import pull
from fleet.errors import HubError, HubReason, UnreachableError
from fleet.replies import Message, NotTaken
from fleet.session import Session
from tests.support.eventually import eventually
from tests.support.hostile_nats_server import INFO, HostileServer, hostile_server


async def _session(server: HostileServer, not_taken: NotTaken | None = None) -> Session:
    return await Session.open(
        server.url, credentials=None, ca=None, inbox="_INBOX_r1", name="", not_taken=not_taken
    )


def _hmsg(number: bytes, subject: bytes, headers: bytes, payload: bytes = b"") -> bytes:
    sizes = b"%d %d" % (len(headers), len(headers) + len(payload))
    return b"HMSG %s %s %s\r\n%s%s\r\n" % (subject, number, sizes, headers, payload)


async def _lost(session: Session) -> HubError:
    async with asyncio.timeout(10):
        return await asyncio.shield(session.lost)


@pytest.mark.parametrize(
    "headers",
    [
        b"NATS/1.0 \xff\xff\xff\r\n\r\n",
        b"NATS/1.0 409 \xff\r\n\r\n",
        b"NATS/1.0\r\n\xff\xfe: \x1b\r\n\r\n",
        b"NATS/1.0",
        b"\x00\x01",
        b"NATS/1.0\r\n" + b"a: b\r\n" * 100_000,
    ],
)
async def test_headers_without_sense_cost_no_connection(headers: bytes) -> None:
    async with hostile_server(lambda number, reply: _hmsg(number, reply, headers, b"yes")) as server:
        session = await _session(server)
        try:
            for _ in range(3):
                assert (await session.request("x", b"", 5)).payload == b"yes"
        finally:
            await session.close()


async def test_headers_beyond_their_bound_are_not_kept() -> None:
    """Half a MiB of them in each message: a hundred would be half a GiB of strings."""
    headers = b"NATS/1.0\r\n" + b"".join(b"%06d: %06d\r\n" % (each, each) for each in range(33_000)) + b"\r\n"
    assert len(headers) > 512 * 1024
    not_taken = NotTaken()
    async with hostile_server(lambda number, reply: 20 * _hmsg(number, reply, headers)) as server:
        session = await _session(server, not_taken)
        try:
            with session.waiter("x") as (waiter, reply):
                await session.send("x", b"", reply)
                assert [(await waiter.get(10)).headers for _ in range(20)] == [{}] * 20
        finally:
            await session.close()
    assert not_taken.unreadable == 20


async def test_a_status_of_another_client_is_none() -> None:
    """It would be skipped, delivered again, and keep all other commands of the robot back."""
    place = b"$JS.ACK.fleet_commands.r1.1.1.1.1700000000000000000.0"
    headers = b"NATS/1.0 409 Consumer Deleted\r\n\r\n"

    def answer(number: bytes, _reply: bytes) -> bytes:
        sizes = b"%d %d" % (len(headers), len(headers) + 2)
        return b"HMSG fleet.r1.cmd.c1 %s %s %s\r\n%sdo\r\n" % (number, place, sizes, headers)

    async with hostile_server(answer) as server:
        session = await _session(server)
        try:
            async with asyncio.timeout(5), aclosing(pull(session, "fleet_commands", "r1", 1)) as deliveries:
                assert (await anext(deliveries)).payload == b"do"
        finally:
            await session.close()


async def test_a_server_that_gives_up_a_slow_login_does_not_refuse_it() -> None:
    """The defect: who logged in from a computer that stood still was sent for a new login."""
    async with hostile_server(lambda _number, _reply: b"") as server:
        server.info += b"-ERR 'Authentication Timeout'\r\n"
        with pytest.raises(HubError, match="the login took too long") as slow:
            await _session(server)
    assert slow.value.reason is HubReason.UNREACHABLE


async def test_a_hub_that_ends_every_request_is_not_asked_without_pause() -> None:
    requests = 0

    def answer(number: bytes, reply: bytes) -> bytes:
        nonlocal requests
        requests += 1
        return _hmsg(number, reply, b"NATS/1.0 408 Request Timeout\r\n\r\n")

    async def asked() -> int:
        return requests

    async def wait_for_one(session: Session) -> None:
        async with aclosing(pull(session, "fleet_commands", "r1", 1)) as nothing:
            await anext(nothing)

    async with hostile_server(answer) as server:
        session = await _session(server)
        began_s = time.monotonic()
        waiting = asyncio.create_task(wait_for_one(session))
        try:
            await eventually(asked, lambda now: now >= 6, "it asks again and again")
            assert time.monotonic() - began_s >= 1.0, "the pauses between six requests are 1.25 s"
            assert not waiting.done()
        finally:
            await cancel([waiting])
            await session.close()


async def test_a_subject_that_is_no_text_or_too_long_costs_no_connection() -> None:
    not_taken = NotTaken()
    taken: list[Message] = []

    async def take(message: Message) -> None:
        taken.append(message)

    async def count() -> int:
        return len(taken)

    def answer(number: bytes, reply: bytes) -> bytes:
        wrong = (b"a.\xff", b"b.\xff"), (b"a." + b"x" * 9000, b"b" * 9000)
        said = b"".join(b"MSG %s %s %s 1\r\nx\r\n" % (to, number, answer_to) for to, answer_to in wrong)
        return said + b"MSG %s 1 2\r\nok\r\n" % reply

    async with hostile_server(answer) as server:
        session = await _session(server, not_taken)
        try:
            await session.subscribe("a.*", "", take)
            assert (await session.request("x", b"", 5)).payload == b"ok"
            await eventually(count, lambda now: now == 2, "both are taken")
        finally:
            await session.close()
    assert [(each.subject[:3], each.reply) for each in taken] == [("a.\ufffd", ""), ("a.x", "")]
    assert len(taken[1].subject) < 1100
    assert not_taken.unreadable == 4


@pytest.mark.parametrize(
    "said",
    [
        b"PING\r\n" * 100_000,
        b"MSG " + b"x" * 100_000,
        b"MSG x 1 99999999\r\n",
        b"INFO " + b"{" * 200_000,
    ],
    ids=["pings", "a line without end", "a huge message", "a long greeting"],
)
async def test_what_has_no_bound_ends_the_connection(said: bytes) -> None:
    async with hostile_server(lambda _number, _reply: said) as server:
        session = await _session(server)
        try:
            await session.publish("x", b"")
            assert (await _lost(session)).reason is HubReason.UNREACHABLE
        finally:
            await session.close()


@pytest.mark.parametrize("answer", [b'{"stream":' + b"[" * 100_000, b'{"error":{"description":"\\ud800"}}'])
async def test_an_answer_that_can_not_be_parsed_is_an_error(answer: bytes) -> None:
    def said(number: bytes, reply: bytes) -> bytes:
        return b"MSG %s %s %d\r\n%s\r\n" % (reply, number, len(answer), answer)

    async with hostile_server(said) as server, connect(FleetAddress((server.url,))) as hub:
        await hub.connected(10)
        with pytest.raises(HubError) as error:
            await hub.publish_once("x", b"")
        assert error.value.reason is HubReason.INVALID
        assert str(error.value).isprintable()
        assert hub.link.connected


@pytest.mark.parametrize("size", [b'"x"', b"null", b"[]", b"1e3"])
async def test_a_greeting_without_a_size_of_messages_is_no_servers(size: bytes) -> None:
    async with hostile_server(lambda *_: b"") as server:
        server.info = INFO.replace(b"1048576", size)
        with pytest.raises(UnreachableError):
            await _session(server)
