"""What a login of a person is worth, or of the exporter or a receiver: what its owner may do, and no more.

Nothing of the account of the streams takes an answer to them, and nothing delivers where they say.
"""

import json
import time
from collections.abc import Iterator
from contextlib import suppress

import pytest

from fleet import names
from fleet.clock import read_clock
from fleet.connection import FleetAddress, Published, Start
from fleet.errors import HubError, HubReason, RefusedError
from fleet.serving import Request
from fleet.session import Session
from tests.support.attacked_hub import connected, store_with_status, thiefs_session, unchanged
from tests.support.secure_hub import BOTH_SERVERS, SecureHub, secure_hub

_LOGINS = ("reader", "commander", "exporter", "receiver")
_READ = (
    names.EVENTS,
    names.RESULTS,
    *(f"KV_{bucket}" for bucket in (names.STATES, names.RECORDINGS, names.ROBOTS)),
)
_REPLIES = (
    "fleet.b.ev.run.99",
    "fleet.b.res.c99",
    "fleet.b.cmd.c99",
    "fleet.b.up.begin_file",
    "$KV.fleet_state.b",
    "$KV.fleet_robots.b",
    "$KV.fleet_recordings.b.rec",
    "$JS.API.STREAM.DELETE.fleet_events",
    "$JS.API.STREAM.PURGE.fleet_events",
    "$JS.API.STREAM.DELETE.KV_fleet_robots",
    "$JS.API.CONSUMER.DELETE.fleet_commands.b",
    "$JS.API.CONSUMER.MSG.NEXT.fleet_commands.b",
    "$JS.ACK.fleet_commands.b.1.1.1.1700000000000000000.0",
    "_INBOX_b.x",
)


@pytest.fixture(scope="module", params=BOTH_SERVERS)
def hub(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[SecureHub]:
    with secure_hub(tmp_path_factory.mktemp("hub"), binary=request.param) as hub:
        for robot in ("a", "b"):
            hub.enroll(robot)
        yield hub


@pytest.fixture(scope="module")
def logins(hub: SecureHub) -> dict[str, FleetAddress]:
    return {
        "reader": hub.operator("reader"),
        "commander": hub.operator("commander", commands=True),
        "exporter": hub.program("exporter"),
        "receiver": hub.receiver(),
    }


@pytest.mark.parametrize("login", ["reader", "commander", "exporter"])
async def test_people_read_and_do_not_write(
    hub: SecureHub, logins: dict[str, FleetAddress], login: str
) -> None:
    async with connected(logins[login]) as reader, connected(hub.administrator()) as administrator:
        subject = names.event_subject("a", login, 1)
        await administrator.publish_once(subject, b"event")
        assert "a" in await reader.entries(names.ROBOTS)
        newest = await reader.last(names.EVENTS, f"fleet.a.ev.{login}.>")
        assert newest is not None
        assert (newest.subject, newest.payload) == (subject, b"event")
        async for message in reader.follow(names.EVENTS, "fleet.a.ev.>", Start.after(newest.sequence - 1)):
            assert message == newest or message.pending == 0
            break
        assert (await reader.stream_info(names.EVENTS))["state"]["messages"] > 0
        assert abs((await read_clock(reader)).unix_ms() - time.time() * 1000) < 60_000
        for work in (
            reader.put(names.STATES, "a", b""),
            reader.put(names.ROBOTS, "a", b""),
            reader.api("STREAM.DELETE.fleet_events"),
            reader.api("CONSUMER.DELETE.fleet_commands.a"),
        ):
            with pytest.raises(RefusedError):
                await work


@pytest.mark.parametrize("login", _LOGINS)
async def test_commands_are_of_those_who_may_send_them(logins: dict[str, FleetAddress], login: str) -> None:
    async with connected(logins[login]) as hub:
        if login == "commander":
            assert await hub.publish_once("fleet.a.cmd.c1", b"") is Published.DELIVERED
        else:
            with pytest.raises(RefusedError):
                await hub.publish_once("fleet.a.cmd.c1", b"")


@pytest.mark.parametrize(
    "subject",
    [
        "fleet.a.ev.run.7",
        "fleet.a.res.c1",
        "fleet.a.up.begin_file",
        "fleet.a.time",
        "$KV.fleet_state.a",
        "$KV.fleet_robots.a",
        "$JS.API.INFO",
        "$JS.API.STREAM.NAMES",
        "$JS.API.STREAM.INFO.fleet_events",
        "$JS.API.STREAM.CREATE.mine",
        "$JS.API.STREAM.UPDATE.fleet_events",
        "$JS.API.STREAM.PURGE.fleet_events",
        "$JS.API.STREAM.DELETE.fleet_events",
        "$JS.API.STREAM.MSG.GET.fleet_events",
        "$JS.API.STREAM.MSG.DELETE.fleet_events",
        "$JS.API.DIRECT.GET.fleet_commands",
        "$JS.API.CONSUMER.CREATE.fleet_events",
        "$JS.API.CONSUMER.CREATE.fleet_events.x.fleet.>",
        "$JS.API.CONSUMER.DURABLE.CREATE.fleet_events.x",
        "$JS.API.CONSUMER.MSG.NEXT.fleet_events.x",
        "$JS.API.CONSUMER.MSG.NEXT.fleet_commands.b",
        "$JS.API.CONSUMER.INFO.fleet_commands.b",
        "$JS.API.CONSUMER.DELETE.fleet_commands.b",
        "$JS.ACK.fleet_commands.b.1.1.1.1.0",
        "fleet.info.fleet_commands",
        "$SYS.REQ.CLAIMS.UPDATE",
        "_INBOX.x",
        "_R_.x",
    ],
)
@pytest.mark.parametrize("login", _LOGINS)
async def test_nothing_else_takes_their_messages(
    logins: dict[str, FleetAddress], login: str, subject: str
) -> None:
    async with thiefs_session(logins[login]) as session:
        with pytest.raises(RefusedError, match="do not permit"):
            await session.request(subject, b"", 5.0)


@pytest.mark.parametrize("reply", _REPLIES)
@pytest.mark.parametrize("login", _LOGINS)
async def test_no_answer_goes_into_the_place_of_another(
    hub: SecureHub, logins: dict[str, FleetAddress], login: str, reply: str
) -> None:
    """The servers publish answers with all rights of an account, wherever a client has them sent."""
    async with thiefs_session(logins[login]) as session, unchanged(hub, bait=b""):
        for stream in _READ:
            for request in (b"", b"{", b'{"seq": 1}', b'{"seq": 1000000}', b'{"last_by_subj": ">"}'):
                await session.send(f"$JS.API.DIRECT.GET.{stream}", request, reply)
            await session.send(names.info_subject(stream), b"", reply)
            # What their logins permitted before.
            await session.send(f"$JS.API.STREAM.INFO.{stream}", b"", reply)
            with suppress(RefusedError):
                await session.request(f"$JS.API.CONSUMER.CREATE.{stream}.x.>", _consumer(stream), 5.0)
            for request in (b'{"no_wait": true, "batch": 1}', b'{"batch": 0}', b"{"):
                await session.send(f"$JS.API.CONSUMER.MSG.NEXT.{stream}.x", request, reply)
            await session.send(f"$JS.API.CONSUMER.DELETE.{stream}.x", b"", reply)
        await session.send("fleet.b.get.get_files", b"", reply)
        if login == "receiver":
            await session.send("$KV.fleet_recordings.a.rec", b"", reply)
        if login == "commander":
            await session.send(f"fleet.a.cmd.{time.monotonic_ns()}", b"", reply)
        # What was sent before is done when these are.
        for stream in _READ if login != "receiver" else ():
            await session.request(f"$JS.API.DIRECT.GET.{stream}", b'{"seq": 1000000}', 5.0)
        if login == "receiver":
            await session.request("$KV.fleet_recordings.a.rec", b"", 5.0)


@pytest.mark.parametrize("to", [each for each in _REPLIES if not each.startswith("_")])
@pytest.mark.parametrize("login", _LOGINS)
async def test_no_consumer_delivers_where_they_say(
    hub: SecureHub, logins: dict[str, FleetAddress], login: str, to: str
) -> None:
    """A consumer that pushes delivers in the account of the streams."""
    async with (
        thiefs_session(logins[login]) as session,
        unchanged(hub, bait=b'{"batch": 1, "expires": 1000000000}'),
    ):
        for stream in _READ:
            call = f"$JS.API.CONSUMER.CREATE.{stream}.pushes.>"
            with pytest.raises(RefusedError, match="do not permit"):
                await session.request(call, _consumer(stream, name="pushes", deliver_subject=to), 5.0)


async def test_answers_of_receivers_to_people_put_nothing_into_streams(
    hub: SecureHub, logins: dict[str, FleetAddress]
) -> None:
    async def handle(request: Request) -> None:
        await request.respond(b"urls")

    async with (
        connected(logins["receiver"]) as receiver,
        thiefs_session(logins["reader"]) as session,
        unchanged(hub),
    ):
        await receiver.serve(names.READING_SUBJECTS, names.RECEIVERS, handle, at_once=100, of_people=True)
        subject = names.reading_subject("b", "get_files")
        for reply in (*_REPLIES, "_INBOXx.y"):
            await session.send(subject, b"", reply)
        # What was sent before is done when this is.
        assert (await session.request(subject, b"", 5.0)).payload == b"urls"


async def test_without_a_receiver_people_learn_of_it(logins: dict[str, FleetAddress]) -> None:
    async with connected(logins["reader"]) as reader:
        with pytest.raises(HubError) as unserved:
            await reader.request(names.reading_subject("b", "get_files"), b"")
        # 2.9 says nothing of it to another account.
        assert unserved.value.reason in {HubReason.NO_RESPONDERS, HubReason.TIMEOUT}


async def test_headers_of_a_robot_change_nothing_of_what_people_read(
    hub: SecureHub, logins: dict[str, FleetAddress]
) -> None:
    """What the hub says of a message has the form of headers, as has what its sender says."""
    lies = {"Nats-Sequence": "1", "Nats-Subject": "fleet.b.ev.run.1", "Nats-Num-Pending": "9"}
    subjects = [f"fleet.a.ev.lies.{number}" for number in range(3)]
    async with thiefs_session(hub.address(hub.path / "a" / "bridge.creds", names.inbox_prefix("a"))) as thief:
        # A stream takes 64 KiB of headers.
        for subject, headers in zip(subjects, (lies, {"x": "y" * 65_300} | lies, {}), strict=True):
            stored = await thief.request(subject, subject.encode(), 5.0, headers)
            assert b"error" not in stored.payload
    async with connected(logins["reader"]) as reader:
        read = []
        async for message in reader.follow(names.EVENTS, "fleet.a.ev.lies.*", Start.all()):
            read.append((message.subject, message.payload.decode()))
            if len(read) == len(subjects):
                break
    assert read == [(subject, subject) for subject in subjects]


async def test_a_status_of_a_robot_is_read_as_no_answer_of_the_hub(
    hub: SecureHub, logins: dict[str, FleetAddress], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The defect: requests of people were sent again and again. 2.9 stores such a status, 2.15.1 none."""
    requests: list[str] = []
    send = Session.send

    async def counted(self: Session, subject: str, payload: bytes, reply: str) -> None:
        requests.append(subject)
        await send(self, subject, payload, reply)

    monkeypatch.setattr(Session, "send", counted)
    statuses = ("503", "404", "204", "408 Request Timeout")
    subjects = [f"fleet.a.ev.status.{number}" for number in range(len(statuses))]
    sequences = []
    async with (
        thiefs_session(hub.address(hub.path / "a" / "bridge.creds", names.inbox_prefix("a"))) as thief,
        connected(logins["reader"]) as reader,
    ):
        for subject, status in zip(subjects, statuses, strict=True):
            await store_with_status(thief, subject, status)
            requests.clear()
            newest = await reader.last(names.EVENTS, subject)
            assert requests == [f"$JS.API.DIRECT.GET.{names.EVENTS}"]
            assert newest is not None
            assert newest.payload == subject.encode()
            sequences.append(newest.sequence)
            await store_with_status(thief, f"$KV.{names.STATES}.a", status)
            assert "a" in await reader.entries(names.STATES)
            assert "a" in await reader.entries(names.STATES, "a")
        # Each of them as the first one of an answer, the last one alone in it.
        for first, sequence in enumerate(sequences):
            read = []
            async for message in reader.follow(names.EVENTS, "fleet.a.ev.>", Start.after(sequence - 1)):
                read.append(message.payload.decode())
                if len(read) == len(subjects) - first:
                    break
            assert read == subjects[first:]


def _consumer(stream: str, **more: str) -> bytes:
    config = {"name": "x", "ack_policy": "none", "filter_subject": ">", "mem_storage": True, **more}
    return json.dumps({"stream_name": stream, "config": config}).encode()
