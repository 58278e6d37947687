"""A hub that was made when people and receivers were in the account of the streams, and how it goes on."""

import asyncio
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from common.errors import UserError
from fleet import names
from fleet.connection import FleetAddress, Published, Start, connect
from fleet.errors import RefusedError
from fleet.identity import Account, Permissions, Service, account_jwt, new_user
from fleet.serving import Request
from hub import administration
from hub.cli import app
from hub.directory import ACCOUNTS_OF_PEOPLE, Kind, User
from hub.jetstream.streams import stream_configs
from hub.server_config import with_accounts
from tests.support.attacked_hub import connected
from tests.support.secure_hub import BOTH_SERVERS, SecureHub, until_accepted

_SERVICES = (
    Service(names.EVENT_SUBJECTS),
    Service(names.RESULT_SUBJECTS),
    Service(f"$KV.{names.STATES}.*"),
    Service(names.UPLOAD_SUBJECTS, many=True),
    Service(f"$JS.API.CONSUMER.INFO.{names.COMMANDS}.*", local="fleet.$1.time"),
    Service(f"$JS.API.CONSUMER.MSG.NEXT.{names.COMMANDS}.*", many=True),
    Service(f"$JS.ACK.{names.COMMANDS}.*.>"),
)
"""All of them of the account of the streams, with the receivers in it."""


@pytest.fixture(params=BOTH_SERVERS)
def hub(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[SecureHub]:
    """Such a hub, with the robot r1."""
    hub = SecureHub(tmp_path, binary=request.param)
    keys = {name: hub.directory.key(name) for name in ("operator", "fleet", "robots", "system")}
    imports = tuple((keys["fleet"].public, each) for each in _SERVICES)
    accounts = {
        "system": Account("system"),
        "fleet": Account("lab", stores=True, exports=_SERVICES),
        "robots": Account("lab robots", imports=imports),
    }
    tokens = {
        keys[name].public: account_jwt(
            keys["operator"], keys[name].public, account, issued_unix_s=hub.directory.read().issued
        )
        for name, account in accounts.items()
    }
    for name in ACCOUNTS_OF_PEOPLE:
        (hub.directory.path / "keys" / f"{name}.nk").unlink()
    config = hub.directory.path / "nodes" / "n0" / "nats.conf"
    config.write_text(with_accounts(config.read_text(encoding="utf-8"), tokens), encoding="utf-8")
    try:
        hub.servers.start_all()
        asyncio.run(_make_streams(hub))
        yield hub
    finally:
        hub.servers.close()


async def _make_streams(hub: SecureHub) -> None:
    async with connected(hub.administrator()) as administrator:
        for name, config in stream_configs(1).items():
            await administrator.api(f"STREAM.CREATE.{name}", {**config, "allow_direct": False})
    await administration.enroll(hub.directory, "r1", hub.path / "r1")


def _issue(hub: SecureHub, kind: Kind, name: str) -> FleetAddress:
    """Issues credentials as they were issued then; returns how their owner connects."""
    allowed = Permissions(publish=("$JS.API.>", "$KV.>"), subscribe=("_INBOX.>", "fleet.>"), respond_s=3600)
    creds, key = new_user(hub.directory.key("fleet"), name, allowed)
    hub.directory.write(hub.directory.read().with_user(User(name, kind, (key,))))
    path = hub.path / f"{name}.old"
    path.write_text(creds.text(), encoding="ascii")
    return hub.address(path)


async def test_apply_moves_people_and_receivers_and_loses_nothing(hub: SecureHub) -> None:
    anna, receiver = _issue(hub, "operator", "anna"), _issue(hub, "receiver", "receiver")
    robot_address = hub.address(hub.path / "r1" / "bridge.creds", names.inbox_prefix("r1"))
    async with connected(robot_address) as robot, connected(anna) as old:
        assert await robot.publish_once("fleet.r1.ev.run.1", b"before") is Published.DELIVERED
        done = await asyncio.to_thread(_type, hub, "apply")
        path = hub.directory.path
        assert "anna: the credentials of this operator end now" in done
        assert f"robot-bridge hub operator anna --again --dir {path}" in done
        assert f"robot-bridge hub receiver-credentials --name receiver --out DIR --again --dir {path}" in done
        assert "The hub is ready" in done
        assert await old.changed.wait_until(lambda: not old.link.connected, 20)
        for address in (anna, receiver):
            async with connect(address) as again:
                with pytest.raises(RefusedError):
                    await until_accepted(again)
        # The robot notices nothing.
        assert await robot.publish_once("fleet.r1.ev.run.2", b"after") is Published.DELIVERED
        await robot.put(names.STATES, "r1", b"state")
        await _read_and_answer(hub, robot_address)
    assert "credentials" not in await asyncio.to_thread(_type, hub, "apply")
    text = (hub.directory.path / "nodes" / "n0" / "nats.conf").read_text(encoding="utf-8")
    assert hub.directory.key("people").public in text


async def _read_and_answer(hub: SecureHub, robot_address: FleetAddress) -> None:
    """With new credentials, people read what was there before, and receivers answer robots and people."""

    async def answer(request: Request) -> None:
        await request.respond(b"answer")

    login = await asyncio.to_thread(_type, hub, "operator", "anna", "--again")
    creds = hub.path / "anna.creds"
    creds.write_text(login.partition("credentials:\n")[2].partition("authority:")[0], encoding="ascii")
    out = hub.path / "receiver"
    await asyncio.to_thread(_type, hub, "receiver-credentials", "--again", "--out", str(out))
    async with (
        connected(hub.address(creds)) as reader,
        connected(hub.address(out / "receiver.creds")) as receiver,
        connected(robot_address) as robot,
    ):
        read = []
        async for message in reader.follow(names.EVENTS, "fleet.r1.ev.>", Start.all()):
            read.append(message.payload)
            if len(read) == 2:
                break
        assert read == [b"before", b"after"]
        assert (await reader.entries(names.STATES))["r1"].value == b"state"
        for subjects, of_people in ((names.UPLOAD_SUBJECTS, False), (names.READING_SUBJECTS, True)):
            await receiver.serve(subjects, names.RECEIVERS, answer, of_people=of_people)
        assert await robot.request(names.upload_subject("r1", "begin_file"), b"") == b"answer"
        assert await reader.request(names.reading_subject("r1", "get_files"), b"") == b"answer"
        await receiver.put(names.RECORDINGS, "r1.rec", b"stored")


def test_until_then_nothing_else_is_done(hub: SecureHub) -> None:
    anna = _issue(hub, "operator", "anna")
    for command in (
        ("operator", "bob"),
        ("operator", "anna", "--again"),
        ("receiver-credentials", "--out", str(hub.path / "out")),
        ("revoke", "r1"),
    ):
        with pytest.raises(UserError, match="a hub of an earlier version") as refused:
            _type(hub, *command)
        assert f"robot-bridge hub apply --dir {hub.directory.path}" in str(refused.value.remedy)
    assert asyncio.run(_is_admitted(anna))
    # What was to be revoked, `apply` revokes.
    _type(hub, "apply")
    assert not asyncio.run(
        _is_admitted(hub.address(hub.path / "r1" / "bridge.creds", names.inbox_prefix("r1")))
    )


def test_an_apply_that_did_not_reach_the_servers_is_repeated(hub: SecureHub) -> None:
    anna = _issue(hub, "operator", "anna")
    record = hub.directory.read()
    hub.directory.write(replace(record, servers=("tls://127.0.0.1:1",)))
    with pytest.raises(UserError, match="can't be reached"):
        _type(hub, "apply")
    assert asyncio.run(_is_admitted(anna))
    hub.directory.write(replace(hub.directory.read(), servers=record.servers))
    _type(hub, "apply")
    assert not asyncio.run(_is_admitted(anna))


async def _is_admitted(address: FleetAddress) -> bool:
    async with connect(address) as hub:
        try:
            await until_accepted(hub)
        except RefusedError:
            return False
        return True


def _type(hub: SecureHub, *words: str) -> str:
    done = CliRunner().invoke(app, [*words, "--dir", str(hub.directory.path)], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output
