"""The connection to a real server: how it is lost, found to be lost, and made again."""

import asyncio
import time
from collections.abc import Iterator
from contextlib import AsyncExitStack, aclosing, suppress
from pathlib import Path

import pytest

from common.tasks import cancel
from fleet import names
from fleet.connection import FleetAddress, Published, Start, connect
from fleet.consuming import pull
from fleet.errors import HubError, HubReason, UnreachableError
from fleet.replies import Message
from fleet.serving import Request
from fleet.session import Session
from hub.jetstream import streams
from tests.support.eventually import at_most
from tests.support.free import free_tcp_port
from tests.support.nats_servers import NatsServers, nats_servers
from tests.support.promise import keeps_async
from tests.support.secure_hub import SecureHub
from tests.support.silent_server import silent_server, tried_in_order

_FOUND_WITHIN_S = 15.0
"""docs/fleet.md: a half-open connection."""


@pytest.fixture
def servers(tmp_path: Path) -> Iterator[NatsServers]:
    with nats_servers(tmp_path) as servers:

        async def set_up() -> None:
            async with connect(FleetAddress(servers.urls)) as hub:
                await hub.connected(10)
                await streams.set_up(hub, 1, streams.StreamLimits())
                await streams.add_command_consumer(hub, "r1")

        asyncio.run(set_up())
        yield servers


async def test_without_a_server_calls_fail_at_once() -> None:
    async with connect(FleetAddress((f"nats://127.0.0.1:{free_tcp_port()}",))) as hub:
        begin_s = time.monotonic()
        with pytest.raises(UnreachableError):
            await hub.publish_once("fleet.r1.ev.run.1", b"")
        assert time.monotonic() - begin_s < 4, "it does not wait for an answer, which may take 5 s"
        assert await hub.changed.wait_until(lambda: hub.link.reason is not None, 20)
        with pytest.raises(UnreachableError, match="can't be reached"):
            await hub.connected(1.0)
        assert hub.link.reason is HubReason.UNREACHABLE


async def test_a_silent_server_keeps_no_caller_from_another_one(
    servers: NatsServers, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The defect: they were tried one after the other, and callers waited no longer than for the first."""
    tried_in_order(monkeypatch)
    with silent_server() as silent, silent_server() as other:
        async with connect(FleetAddress((silent, other, *servers.urls))) as hub:
            await hub.connected(30)
            assert hub.link.server == servers.urls[0]
            await hub.publish_once("fleet.r1.ev.run.1", b"")


async def test_an_attempt_at_a_server_that_falls_silent_within_tls_ends_when_it_is_cancelled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Or the session with the server that did answer would wait for it."""
    tried_in_order(monkeypatch)
    ca = SecureHub(tmp_path).directory.ca_file
    greeted = asyncio.Event()

    async def greet(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b'INFO {"max_payload":1000,"headers":true,"tls_required":true}\r\n')
        # The first message of TLS.
        await reader.read(65536)
        greeted.set()
        await _read_to_its_end(reader, writer)

    async with await asyncio.start_server(greet, "127.0.0.1", 0) as server:
        url = f"tls://127.0.0.1:{server.sockets[0].getsockname()[1]}"
        opening = asyncio.create_task(Session.open(url, credentials=None, ca=ca, inbox="_INBOX.x", name=""))
        async with asyncio.timeout(20):
            await greeted.wait()
        opening.cancel()
        ended, _ = await asyncio.wait({opening}, timeout=20)
        assert ended


async def test_a_restart_of_the_server_is_survived(servers: NatsServers) -> None:
    """What is followed goes on where it was, and what is served is served again."""

    async def answer(request: Request) -> None:
        await request.respond(request.payload)

    async with (
        connect(FleetAddress(servers.urls)) as hub,
        connect(FleetAddress(servers.urls, inbox=names.inbox_prefix("r1"))) as robot,
    ):
        for each in (hub, robot):
            await each.connected(10)
        await hub.serve(names.UPLOAD_SUBJECTS, names.RECEIVERS, answer)
        await robot.publish_once("fleet.r1.ev.run.1", b"1")
        async with (
            aclosing(hub.follow(names.EVENTS, "fleet.r1.ev.>", Start.all())) as events,
            aclosing(robot.pull(names.COMMANDS, "r1")) as commands,
        ):
            assert (await anext(events)).payload == b"1"
            # At first there is none: the request waits at the server that is killed.
            command = asyncio.ensure_future(anext(commands))
            servers.kill(0)
            assert await robot.changed.wait_until(lambda: not robot.link.connected, 5)
            with pytest.raises(UnreachableError):
                await robot.request("fleet.r1.up.begin_file", b"")
            await asyncio.to_thread(servers.start_all)
            for each in (hub, robot):
                await each.connected(20)
            assert await robot.publish_once("fleet.r1.ev.run.1", b"1") is Published.REPEATED
            await robot.publish_once("fleet.r1.ev.run.2", b"2")
            assert (await anext(events)).payload == b"2"
            await hub.publish_once(names.command_subject("r1", "c1"), b"do")
            delivery = await command
            assert delivery.payload == b"do"
            await delivery.ack()
            assert await robot.request("fleet.r1.up.begin_file", b"again") == b"again"


async def test_a_server_that_dies_while_something_is_being_sent_is_lost(servers: NatsServers) -> None:
    async def talk(session: Session) -> None:
        with suppress(UnreachableError):
            while True:
                await session.publish("quiet", b"x")
                await asyncio.sleep(0)

    async with AsyncExitStack() as stack:
        sessions: list[Session] = []
        for _ in range(8):
            session = await Session.open(
                servers.urls[0], credentials=None, ca=None, inbox="_INBOX.x", name=""
            )
            stack.push_async_callback(session.close)
            sessions.append(session)
        talking = [asyncio.create_task(talk(each)) for each in sessions]
        await asyncio.sleep(0)
        servers.kill(0)
        lost = [asyncio.shield(each.lost) for each in sessions]
        _, missed = await asyncio.wait(lost, timeout=5)
        assert not missed, f"{len(missed)} of {len(sessions)} do not know that they are lost"
        await asyncio.gather(*talking)


@pytest.mark.timed
async def test_a_silent_server_is_found(servers: NatsServers) -> None:
    """Frozen, it keeps its connections open, as a half-open TCP connection is."""
    async with connect(FleetAddress(servers.urls)) as hub:
        await hub.connected(10)
        servers.freeze(0)
        try:
            assert await hub.changed.wait_until(lambda: not hub.link.connected, _FOUND_WITHIN_S)
        finally:
            servers.thaw(0)
        await hub.connected(20)
        await hub.publish_once("fleet.r1.ev.run.1", b"")


@pytest.mark.timed
@pytest.mark.timeout(300)  # up to four attempts of 15 s each
async def test_a_silent_server_is_found_while_much_waits_to_be_sent(servers: NatsServers) -> None:
    """The defect: each ping first waited for 5 s for what the server did not take."""

    async def send(session: Session) -> None:
        with suppress(UnreachableError):
            while True:
                await session.publish("quiet", bytes(names.LARGEST_MESSAGE))

    async def found_s() -> float:
        session = await Session.open(servers.urls[0], credentials=None, ca=None, inbox="_INBOX.x", name="")
        servers.freeze(0)
        begun_s = time.monotonic()
        sending = asyncio.create_task(send(session))
        try:
            async with at_most(60, "the connection is lost"):
                await asyncio.shield(session.lost)
            return time.monotonic() - begun_s
        finally:
            # First: to a server that goes on, over a session that stands, it would send without a pause.
            await session.close()
            await cancel([sending])
            servers.thaw(0)

    await keeps_async(_FOUND_WITHIN_S, "s until a silent server is found", found_s)


async def test_an_answer_that_comes_too_late_costs_no_connection(servers: NatsServers) -> None:
    async with connect(FleetAddress(servers.urls)) as hub:
        await hub.connected(10)
        session = await Session.open(servers.urls[0], credentials=None, ca=None, inbox="_INBOX.x", name="")
        try:
            servers.freeze(0)
            waiting = asyncio.ensure_future(session.subscribe("quiet", "", _ignore))
            await asyncio.sleep(0)
            done, _ = await asyncio.wait([waiting], timeout=30)
            assert isinstance(waiting.exception(), UnreachableError), done
            servers.thaw(0)
            acknowledgement = await session.request("fleet.r1.ev.run.1", b"", 5)
            assert b"fleet_events" in acknowledgement.payload
            assert not session.lost.done()
        finally:
            servers.thaw(0)
            await session.close()


async def _ignore(_message: Message) -> None:
    """Takes a message and does nothing."""


async def test_a_bucket_is_read_and_watched(servers: NatsServers) -> None:
    async with connect(FleetAddress(servers.urls)) as hub:
        await hub.connected(10)
        assert await hub.entries(names.STATES) == {}
        for number in range(300):
            await hub.put(names.STATES, f"r{number}", b"old")
        await hub.put(names.STATES, "r7", b"new")
        await hub.delete(names.STATES, "r8")
        entries = await hub.entries(names.STATES)
        assert len(entries) == 299
        assert entries["r7"].value == b"new"
        assert set(await hub.entries(names.STATES, "r7")) == {"r7"}
        async with aclosing(hub.watch_bucket(names.STATES)) as watched:
            first = [await anext(watched) for _ in range(300)]
            assert {each.key for each in first if not each.deleted} == entries.keys()
            assert first[-1].pending == 0
            await hub.put(names.STATES, "r8", b"back")
            assert (await anext(watched)).value == b"back"


async def test_answers_for_another_robot_are_not_given(servers: NatsServers) -> None:
    asked: list[str] = []

    async def answer(request: Request) -> None:
        asked.append(request.robot)
        await request.respond(b"")

    async with (
        connect(FleetAddress(servers.urls)) as receiver,
        connect(FleetAddress(servers.urls, inbox=names.inbox_prefix("r1"))) as robot,
    ):
        for each in (receiver, robot):
            await each.connected(10)
        with pytest.raises(HubError) as unserved:
            await robot.request("fleet.r1.up.begin_file", b"")
        assert unserved.value.reason is HubReason.NO_RESPONDERS
        await receiver.serve(names.UPLOAD_SUBJECTS, names.RECEIVERS, answer)
        # In a hub without identities nothing else keeps it from that.
        with pytest.raises(HubError):
            await robot.request("fleet.r2.up.begin_file", b"", 0.5)
        await robot.request("fleet.r1.up.begin_file", b"")
        assert asked == ["r1"]


async def test_more_requests_than_permitted_are_refused_with_the_reason(servers: NatsServers) -> None:
    proceed = asyncio.Event()

    async def answer(request: Request) -> None:
        await proceed.wait()
        await request.respond(b"done")

    async with (
        connect(FleetAddress(servers.urls)) as receiver,
        connect(FleetAddress(servers.urls, inbox=names.inbox_prefix("r1"))) as robot,
    ):
        for each in (receiver, robot):
            await each.connected(10)
        await receiver.serve(names.UPLOAD_SUBJECTS, names.RECEIVERS, answer, at_once=2, busy=b"busy")
        pending = [asyncio.ensure_future(robot.request("fleet.r1.up.x", b"")) for _ in range(3)]
        done, _ = await asyncio.wait(pending, return_when=asyncio.FIRST_COMPLETED)
        assert [each.result() for each in done] == [b"busy"]
        proceed.set()
        assert sorted(await asyncio.gather(*pending)) == [b"busy", b"done", b"done"]


async def test_one_robot_has_a_share_of_the_requests_in_hand(servers: NatsServers) -> None:
    proceed, other_is_served = asyncio.Event(), asyncio.Event()

    async def answer(request: Request) -> None:
        if request.robot == "r2":
            other_is_served.set()
        await proceed.wait()
        await request.respond(b"done")

    async with (
        connect(FleetAddress(servers.urls)) as receiver,
        connect(FleetAddress(servers.urls, inbox=names.inbox_prefix("r1"))) as greedy,
        connect(FleetAddress(servers.urls, inbox=names.inbox_prefix("r2"))) as other,
    ):
        for each in (receiver, greedy, other):
            await each.connected(10)
        await receiver.serve(
            names.UPLOAD_SUBJECTS, names.RECEIVERS, answer, at_once=4, of_one=2, busy=b"busy"
        )
        pending = [asyncio.ensure_future(greedy.request("fleet.r1.up.x", b"", 20)) for _ in range(6)]
        while sum(each.done() for each in pending) < 4:
            await asyncio.wait([each for each in pending if not each.done()], return_when="FIRST_COMPLETED")
        asked = asyncio.ensure_future(other.request("fleet.r2.up.x", b"", 20))
        await asyncio.wait_for(other_is_served.wait(), 20)
        proceed.set()
        assert await asked == b"done"
        assert sorted(await asyncio.gather(*pending)) == [b"busy"] * 4 + [b"done"] * 2


async def test_requests_that_take_long_keep_no_others_out(servers: NatsServers) -> None:
    proceed = asyncio.Event()

    async def answer(request: Request) -> None:
        if request.name == "verify_file":
            await proceed.wait()
        await request.respond(b"done")

    async with (
        connect(FleetAddress(servers.urls)) as receiver,
        connect(FleetAddress(servers.urls, inbox=names.inbox_prefix("r1"))) as robot,
    ):
        await receiver.connected(10)
        await robot.connected(10)
        await receiver.serve(
            names.UPLOAD_SUBJECTS, names.RECEIVERS, answer, at_once=2, busy=b"busy", long={"verify_file"}
        )
        verify, begin = names.upload_subject("r1", "verify_file"), names.upload_subject("r1", "begin_file")
        pending = {asyncio.create_task(robot.request(verify, b"", 20)) for _ in range(3)}
        done, pending = await asyncio.wait(pending, return_when=asyncio.FIRST_COMPLETED)
        assert [each.result() for each in done] == [b"busy"]
        assert await robot.request(begin, b"", 20) == b"done"
        proceed.set()
        assert await asyncio.gather(*pending) == [b"done", b"done"]


async def test_a_consumer_that_the_server_has_not_heard_of_yet_is_waited_for(
    servers: NatsServers, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a cluster, a node that has just started passes nothing on to a consumer that has just been made."""
    # It is made in time, however long this machine stands still.
    monkeypatch.setattr("fleet.consuming._KNOWN_WITHIN_S", 20.0)
    session = await Session.open(servers.urls[0], credentials=None, ca=None, inbox="_INBOX.x", name="")
    async with connect(FleetAddress(servers.urls)) as hub:
        await hub.connected(10)
        await hub.publish_once(names.command_subject("r2", "c1"), b"early")
        async with aclosing(pull(session, names.COMMANDS, "r2", 1)) as deliveries:
            first = asyncio.ensure_future(anext(deliveries))
            # The first request has been refused by then.
            await asyncio.wait({first}, timeout=0.3)
            assert not first.done()
            await streams.add_command_consumer(hub, "r2")
            assert (await asyncio.wait_for(first, 20)).payload == b"early"
    await session.close()


async def test_a_consumer_that_never_appears_is_an_error(servers: NatsServers) -> None:
    session = await Session.open(servers.urls[0], credentials=None, ca=None, inbox="_INBOX.x", name="")
    async with aclosing(pull(session, names.COMMANDS, "r2", 1)) as deliveries:
        with pytest.raises(HubError, match="does not know the consumer r2") as caught:
            await asyncio.wait_for(anext(deliveries), 10)
    assert caught.value.reason is HubReason.NO_RESPONDERS
    await session.close()


_GREETINGS = (
    b"",
    b"HTTP/1.1 400 Bad Request\r\n\r\n",
    b"INFO {\r\n",
    b"INFO []\r\n",
    b"INFO " + b"x" * 200_000,
    b'INFO {"max_payload":1000,"headers":true}\r\nPONG\r\nMSG a 1 999999999\r\n' + b"x" * 8_000_000,
    b'INFO {"max_payload":"x","headers":true}\r\nPONG\r\n',
    b"-ERR 'Maximum Connections Exceeded'\r\n",
)


async def test_a_server_may_say_anything() -> None:
    await asyncio.gather(*(_hear(greeting) for greeting in _GREETINGS))


async def _read_to_its_end(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Reads until the other side closes the connection, and closes it as well."""
    try:
        while await reader.read(65536):
            pass
    except ConnectionError:
        return
    finally:
        writer.close()


async def _hear(greeting: bytes) -> None:
    """Connects to a server that says this, whatever it is asked."""

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(greeting)
        await _read_to_its_end(reader, writer)

    async with await asyncio.start_server(talk, "127.0.0.1", 0) as server:
        url = f"nats://127.0.0.1:{server.sockets[0].getsockname()[1]}"
        async with connect(FleetAddress((url,))) as hub:
            await hub.changed.wait_until(lambda: hub.link.reason is not None, 12)
            assert (hub.link.connected, hub.link.reason) == (False, HubReason.UNREACHABLE), greeting[:80]
