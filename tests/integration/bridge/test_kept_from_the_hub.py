"""A hub that asks a robot for its configuration, in every way that there is to ask: it stays on the robot."""

import asyncio
import json
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, Final

import pytest

from fleet import names
from fleet.connection import Hub
from fleet.replies import Message
from fleet.session import Session
from hub.permissions import robot as permissions_of
from omniseer.fleet.v1 import command_pb2
from omniseer.gateway.v1.system_status_pb2 import SystemStatus
from tests.integration.bridge.test_commands import REFUSED, issue, results
from tests.integration.bridge.test_events import all_there
from tests.support.event_server import EventServer
from tests.support.eventually import eventually
from tests.support.nats_servers import NatsServers
from tests.support.running_bridge import ROBOT, bridge_program

CANARY: Final = "canary"
"""In each value of the configuration that may be anything, and in what its files have."""
ANSWERS: Final = "hostile.answer"
UNKNOWN_FIELDS: Final = range(8, 16)
SUBJECTS: Final = (
    f"fleet.{ROBOT}.config",
    f"fleet.{ROBOT}.get.config",
    f"fleet.{ROBOT}.get.get_files",
    f"fleet.{ROBOT}.up.config",
    f"fleet.{ROBOT}",
    f"{ROBOT}.config",
    f"robot-bridge.{ROBOT}",
    "$SRV.INFO",
    "$SRV.PING",
)
"""Also those by which programs that use the NATS library's micro-services answer."""


def configuration(directory: Path, gateway_port: int) -> dict[str, Any]:
    token = directory / f"{CANARY}-token"
    token.write_text(f"{CANARY}token", encoding="utf-8")
    token.chmod(0o600)
    return {
        "root": str(directory / f"{CANARY}-outbox"),
        "gateway": {"target": f"127.0.0.1:{gateway_port}", "token_file": str(token)},
        "uploads": {"store_hosts": [f"{CANARY}.example/{CANARY}"], "interfaces": [f"{CANARY}0"]},
    }


def action_of_another_schema(field: int) -> bytes:
    """A command whose action no robot knows: a string in a field of its own."""
    wanted = b"bridge.yaml"
    command = command_pb2.Command(command_id=f"c{field}", robot=ROBOT, issued_by="anna", expires_after_s=60)
    return command.SerializeToString() + bytes([field << 3 | 2, len(wanted)]) + wanted


@asynccontextmanager
async def tapped(servers: NatsServers) -> AsyncIterator[tuple[Session, list[Message]]]:
    """A connection that hears all that is said at the hub."""
    heard: list[Message] = []

    async def take(message: Message) -> None:
        heard.append(message)

    session = await Session.open(servers.urls[0], credentials=None, ca=None, inbox="_INBOX_hostile", name="")
    try:
        await session.subscribe(">", "", take)
        yield session, heard
    finally:
        await session.close()


async def ask(session: Session, *subjects: str) -> None:
    """Asks for the configuration, with a place for answers."""
    for subject in subjects:
        await session.send(subject, b"bridge.yaml", f"{ANSWERS}.x")


def subscriptions(servers: NatsServers) -> list[str]:
    """The subjects that the robot listens to."""
    connections = servers.monitor(0, "connz?subs=1")["connections"]
    (robot,) = [each for each in connections if each.get("name") == f"robot-bridge {ROBOT}"]
    assert CANARY not in json.dumps(robot)
    return list(robot["subscriptions_list"])


def permitted(subject: str) -> bool:
    """Whether a robot's credentials let it publish there, or at what the hub maps to that."""
    if subject == f"$JS.API.CONSUMER.INFO.{names.COMMANDS}.{ROBOT}":
        subject = names.time_subject(ROBOT)
    patterns = (
        re.escape(each).replace(r"\*", r"[^.]+").replace(">", ".+") for each in permissions_of(ROBOT).publish
    )
    return any(re.fullmatch(pattern, subject) for pattern in patterns)


async def test_no_question_of_the_hub_is_answered_with_the_configuration(
    tmp_path: Path, hub: Hub, gateway: EventServer, servers: NatsServers, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The tap counts as a program that answers at people's name of the call, and never does.
    monkeypatch.setattr(names, "info_subject", lambda stream: f"$JS.API.STREAM.INFO.{stream}")
    settings = {"commands": {"allowed": ["upload", "snapshot"]}, **configuration(tmp_path, gateway.port)}
    async with tapped(servers) as (hostile, heard):
        with bridge_program(tmp_path / "bridge", gateway.port, servers.urls, **settings) as bridge:
            await asyncio.to_thread(bridge.start)
            gateway.show(SystemStatus(gateway_name="lab"))
            gateway.happen(10)
            await all_there(hub, gateway)
            listens = await asyncio.to_thread(subscriptions, servers)
            assert listens
            assert all(each.startswith(f"{names.inbox_prefix(ROBOT)}.") for each in listens), "no service"
            await ask(hostile, *SUBJECTS)
            for field in UNKNOWN_FIELDS:
                await issue(hub, f"c{field}", payload=action_of_another_schema(field))
            found = await eventually(
                lambda: results(hub), lambda found: len(found) == len(UNKNOWN_FIELDS), "all are refused"
            )
            # Last, because what is no answer there has the bridge request its commands anew.
            await ask(hostile, *(each.replace("*", "x").replace(">", "x") for each in listens))
            gateway.happen(10)
            await all_there(hub, gateway)
    assert {each.outcome for each in found.values()} == {REFUSED}
    assert not [each.subject for each in heard if each.subject.startswith(ANSWERS)]
    own = [each.subject for each in heard if each.reply.startswith(f"{names.inbox_prefix(ROBOT)}.")]
    assert f"$KV.{names.STATES}.{ROBOT}" in own, "what it says is heard here"
    assert all(map(permitted, own))
    for message in heard:
        said = (
            message.subject.encode(),
            message.payload,
            message.reply.encode(),
            repr(message.headers).encode(),
        )
        assert not any(CANARY.encode() in each.lower() for each in said), message.subject
