"""What a stolen robot key is worth: reports of that robot, until it is revoked. All else is tried here."""

import asyncio
import itertools
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import pytest

from fleet import names
from fleet.connection import FleetAddress, Published, connect
from fleet.errors import HubError, HubReason, RefusedError
from fleet.serving import Request
from hub import administration
from tests.support.attacked_hub import connected, thiefs_session, unchanged
from tests.support.hub_patience import in_the_end
from tests.support.promise import keeps_async
from tests.support.secure_hub import BOTH_SERVERS, SecureHub, secure_hub, until_accepted

_REVOKED_WITHIN_S = 5.0
"""docs/fleet.md."""


@pytest.fixture(scope="module", params=BOTH_SERVERS)
def hub(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[SecureHub]:
    with secure_hub(tmp_path_factory.mktemp("hub"), binary=request.param) as hub:
        yield hub


@pytest.fixture(scope="module")
def thief(hub: SecureHub) -> FleetAddress:
    """The stolen key: robot a's."""
    return hub.enroll("a")


@pytest.fixture(scope="module")
def victim(hub: SecureHub) -> FleetAddress:
    return hub.enroll("b")


async def test_a_robot_reports_and_takes_its_commands(hub: SecureHub, victim: FleetAddress) -> None:
    async with connected(victim) as robot, connected(hub.administrator()) as administrator:
        assert await robot.publish_once("fleet.b.ev.run.1", b"event") is Published.DELIVERED
        assert await robot.publish_once("fleet.b.ev.run.1", b"event") is Published.REPEATED
        assert await robot.publish_once("fleet.b.res.c1", b"result") is Published.DELIVERED
        await robot.put(names.STATES, "b", b"state")
        await administrator.publish_once(names.command_subject("b", "c1"), b"command")
        async for delivery in robot.pull(names.COMMANDS, "b"):
            assert (delivery.subject, delivery.payload) == ("fleet.b.cmd.c1", b"command")
            assert abs(delivery.unix_s - time.time()) < 60
            await delivery.ack()
            break
        assert (await administrator.entries(names.STATES))["b"].value == b"state"


async def test_receivers_answer_the_robot_that_asked(hub: SecureHub, victim: FleetAddress) -> None:
    async def handle(request: Request) -> None:
        for part in (b"1", b"2"):
            await request.respond(request.robot.encode() + request.payload + part)

    async with connected(hub.receiver()) as receiver, connected(victim) as robot:
        await receiver.serve(names.UPLOAD_SUBJECTS, names.RECEIVERS, handle)
        await receiver.put(names.RECORDINGS, "b.rec", b"stored")
        answers = []
        async for answer in robot.request_many(names.upload_subject("b", "verify_file"), b"?"):
            answers.append(answer)
            if len(answers) == 2:
                break
        assert answers == [b"b?1", b"b?2"]


@pytest.mark.parametrize(
    "subject",
    [
        "fleet.b.ev.run.7",
        "fleet.b.res.c1",
        "fleet.b.up.begin_file",
        "fleet.b.get.get_files",
        "fleet.a.get.get_files",
        "fleet.a.cmd.c9",
        "fleet.b.cmd.c9",
        "$KV.fleet_state.b",
        "$KV.fleet_robots.a",
        "$KV.fleet_recordings.a.rec",
        "$JS.API.INFO",
        "$JS.API.STREAM.NAMES",
        "$JS.API.STREAM.LIST",
        "$JS.API.STREAM.INFO.fleet_events",
        "$JS.API.STREAM.CREATE.mine",
        "$JS.API.STREAM.UPDATE.fleet_events",
        "$JS.API.STREAM.PURGE.fleet_events",
        "$JS.API.STREAM.DELETE.fleet_events",
        "$JS.API.STREAM.SNAPSHOT.fleet_events",
        "$JS.API.STREAM.MSG.GET.fleet_events",
        "$JS.API.STREAM.MSG.DELETE.fleet_events",
        "$JS.API.DIRECT.GET.KV_fleet_state",
        "$JS.API.DIRECT.GET.KV_fleet_state.$KV.fleet_state.b",
        "$JS.API.CONSUMER.CREATE.fleet_events",
        "$JS.API.CONSUMER.CREATE.fleet_commands.a.fleet.b.cmd.*",
        "$JS.API.CONSUMER.DURABLE.CREATE.fleet_commands.a",
        "$JS.API.CONSUMER.DELETE.fleet_commands.b",
        "$JS.API.CONSUMER.INFO.fleet_commands.b",
        "$JS.API.CONSUMER.MSG.NEXT.fleet_commands.b",
        "$JS.ACK.fleet_commands.b.1.1.1.1.0",
        "$SYS.REQ.ACCOUNT.PING.CONNZ",
        "$SYS.REQ.SERVER.PING",
        "$SYS.REQ.CLAIMS.UPDATE",
        "_INBOX_b.x",
        "_R_.x",
    ],
)
@pytest.mark.usefixtures("victim")
async def test_nothing_of_others_takes_its_messages(thief: FleetAddress, subject: str) -> None:
    async with thiefs_session(thief) as session:
        with pytest.raises(RefusedError, match="do not permit"):
            await session.request(subject, b"", 5.0)


@pytest.mark.parametrize(
    "subject",
    [">", "*.>", "fleet.>", "fleet.b.>", "fleet.a.cmd.*", "$KV.>", "$JS.>", "$JS.API.>", "$SYS.>",
     "_INBOX_b.>", "_INBOX.>", "_R_.>", "_INBOX_a", "$JS.EVENT.>"],
)  # fmt: skip
async def test_nothing_of_others_can_be_read(thief: FleetAddress, victim: FleetAddress, subject: str) -> None:
    heard: list[str] = []

    async def hear(message: object) -> None:
        heard.append(str(message))

    async with thiefs_session(thief) as session, connected(victim) as robot:
        await session.subscribe(subject, "", hear)
        await robot.publish_once(f"fleet.b.ev.run.{time.monotonic_ns()}", b"event")
        await robot.put(names.STATES, "b", b"state")
        # An answer from the server: it has refused the subscription before.
        await session.request("fleet.a.ev.run.0", b"", 5.0)
        assert heard == []


@pytest.mark.parametrize(
    "reply",
    [
        "fleet.b.ev.run.99",
        "fleet.b.res.c99",
        "fleet.b.cmd.c99",
        "fleet.b.up.begin_file",
        "$KV.fleet_state.b",
        "$KV.fleet_robots.b",
        "$JS.API.STREAM.DELETE.fleet_events",
        "$JS.API.STREAM.PURGE.fleet_events",
        "$JS.API.CONSUMER.DELETE.fleet_commands.b",
        "_INBOX_b.x",
        "_INBOX.x",
    ],
)
@pytest.mark.usefixtures("victim")
async def test_no_answer_goes_into_the_place_of_another(
    hub: SecureHub, thief: FleetAddress, reply: str
) -> None:
    """The servers publish answers with all rights of an account, wherever a client has them sent."""
    async with thiefs_session(thief) as session, unchanged(hub):
        await session.send(f"fleet.a.ev.reply.{time.monotonic_ns()}", b"event", reply)
        await session.send("$KV.fleet_state.a", b"state", reply)
        for request in (
            b'{"no_wait": true, "batch": 1}',
            b'{"batch": 0}',
            b"{",
            b'{"batch":1,"expires":1000000}',
        ):
            await session.send("$JS.API.CONSUMER.MSG.NEXT.fleet_commands.a", request, reply)
        await session.send("$JS.ACK.fleet_commands.a.1.1.1.1.0", b"+ACK", reply)
        await session.send("fleet.a.up.begin_file", b"", reply)
        # What was sent before is done when this is.
        await session.request(f"fleet.a.ev.reply.{time.monotonic_ns()}", b"", 5.0)


@pytest.mark.parametrize(
    "headers",
    [
        {"Nats-Rollup": "all"},
        {"Nats-Rollup": "sub"},
        {"KV-Operation": "PURGE", "Nats-Rollup": "all"},
        {"Nats-TTL": "1s"},
    ],
)
@pytest.mark.usefixtures("victim")
async def test_no_header_deletes_the_states_of_others(
    hub: SecureHub, thief: FleetAddress, headers: dict[str, str]
) -> None:
    async with thiefs_session(thief) as session, unchanged(hub):
        for subject in ("$KV.fleet_state.a", f"fleet.a.ev.headers.{time.monotonic_ns()}"):
            await session.request(subject, b"", 5.0, headers)


async def test_a_robots_own_messages_have_a_limit(thief: FleetAddress) -> None:
    async with thiefs_session(thief) as session:
        with pytest.raises(HubError):
            await session.request("fleet.a.ev.large.1", b"x" * (600 * 1024), 5.0)


async def test_a_flood_of_one_costs_the_others_no_events(
    hub: SecureHub, thief: FleetAddress, victim: FleetAddress
) -> None:
    async with thiefs_session(thief) as session, connected(victim) as robot:
        for sequence in range(3000):
            await session.publish(f"fleet.a.ev.flood.{sequence}", b"x" * 4096)
        for sequence in range(20):
            await in_the_end(partial(robot.publish_once, f"fleet.b.ev.flooded.{sequence}", b"event"))
    async with connected(hub.administrator()) as administrator:
        subjects = {"subjects_filter": "fleet.b.ev.flooded.*"}
        info = await administrator.api(f"STREAM.INFO.{names.EVENTS}", subjects)
        assert len(info["state"]["subjects"]) == 20


@pytest.mark.timed
async def test_a_revoked_robot_is_out_and_stays_out(hub: SecureHub) -> None:
    robots = (f"c{number}" for number in itertools.count())

    async def out_s() -> float:
        name = next(robots)
        address = await asyncio.to_thread(hub.enroll, name)
        async with connected(address) as robot, connected(hub.administrator()) as administrator:
            begun_s = time.monotonic()
            await administration.revoke(hub.directory, "robot", name)
            assert await robot.changed.wait_until(lambda: not robot.link.connected, 20.0)
            needed_s = time.monotonic() - begun_s
            with pytest.raises(RefusedError):
                await robot.publish_once(f"fleet.{name}.ev.run.1", b"")
            assert b'"revoked": true' in (await administrator.entries(names.ROBOTS))[name].value
        async with connect(address) as again:
            with pytest.raises(RefusedError, match="does not accept the credentials"):
                await until_accepted(again)
        return needed_s

    await keeps_async(_REVOKED_WITHIN_S, "s until a revoked robot is out", out_s)


async def test_a_robot_enrolled_again_has_new_keys_and_the_old_ones_end(hub: SecureHub) -> None:
    old = await asyncio.to_thread(hub.enroll, "d")
    kept = old.credentials.rename(old.credentials.with_suffix(".old")) if old.credentials else None
    await administration.enroll(hub.directory, "d", hub.path / "d", again=True)
    async with connect(replace(old, credentials=kept)) as hub_of_old:
        with pytest.raises(RefusedError):
            await until_accepted(hub_of_old)
    async with connected(old) as robot:
        await robot.publish_once("fleet.d.ev.run.1", b"")


async def test_expired_credentials_are_refused(hub: SecureHub) -> None:
    await administration.enroll(hub.directory, "e", hub.path / "e", days=-1)
    address = hub.address(hub.path / "e" / "bridge.creds", names.inbox_prefix("e"))
    async with connect(address) as robot:
        with pytest.raises(RefusedError):
            await until_accepted(robot)


async def test_a_server_without_tls_gets_no_credentials(thief: FleetAddress) -> None:
    """Who sits in between could pass the signature on to the hub."""
    said = bytearray()

    async def pretend(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(
            b'INFO {"server_id":"X","version":"2.15","nonce":"abc","auth_required":true,"max_payload":1}\r\n'
        )
        while data := await reader.read(4096):
            said.extend(data)
        writer.close()

    server = await asyncio.start_server(pretend, "127.0.0.1", 0)
    async with server:
        url = f"tls://127.0.0.1:{server.sockets[0].getsockname()[1]}"
        async with connect(replace(thief, servers=(url,))) as robot:
            with pytest.raises(HubError) as refused:
                await robot.connected(20.0, once=True)
    assert refused.value.reason is HubReason.UNREACHABLE
    assert "does not offer TLS" in str(refused.value)
    assert said == b""
