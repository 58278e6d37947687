"""How fast commands are taken: what a robot only answers keeps back what it is to do for a short time."""

import asyncio
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from types import SimpleNamespace
from typing import Any

from bridge.commands.consumer import CommandConsumer
from bridge.commands.pending_requests import PendingRequests
from bridge.config import BridgeSettings, CommandSettings, HubSettings
from fleet.names import command_subject
from omniseer.fleet.v1 import command_pb2 as pb
from tests.support.eventually import eventually
from tests.support.virtual_time import in_virtual_time

ROBOT = "lab2"
NOW_UNIX_S = 1_800_000_000.0


@dataclass
class Delivery:
    """A message of the stream."""

    subject: str
    payload: bytes
    unix_s: float
    acknowledged: bool = False

    async def ack(self) -> None:
        self.acknowledged = True


@dataclass
class Hub:
    """Has messages, one after the other, and its own time."""

    deliveries: list[Delivery]
    link: Any = field(default_factory=lambda: SimpleNamespace(connections=1))

    async def pull(self, _stream: str, _robot: str, batch: int) -> AsyncIterator[Delivery]:
        assert batch == 1
        for each in self.deliveries:
            yield each
        await asyncio.sleep(1_000_000)

    async def consumer_info(self, _subject: str) -> dict[str, Any]:
        now_s = NOW_UNIX_S + asyncio.get_running_loop().time()
        return {"ts": datetime.fromtimestamp(now_s, UTC).isoformat()}


class Outbox:
    """A disk that takes everything."""

    def __init__(self) -> None:
        self.ended: dict[str, int] = {}

    async def begin_command(self, _command_id: str) -> bool:
        return True

    async def end_command(self, command_id: str, result: bytes) -> None:
        self.ended[command_id] = pb.CommandResult.FromString(result).outcome

    async def unanswered_commands(self) -> list[str]:
        return []


def command(command_id: str, *, age_s: float, expires_after_s: int = 60) -> Delivery:
    made = pb.Command(command_id=command_id, robot=ROBOT, issued_by="anna", expires_after_s=expires_after_s)
    made.snapshot.label = "door"
    return Delivery(command_subject(ROBOT, command_id), made.SerializeToString(), NOW_UNIX_S - age_s)


async def taken(deliveries: list[Delivery], command_id: str) -> tuple[float, PendingRequests, Outbox]:
    """Takes commands until one of them is handed over or has ended; returns when that was."""
    loop, hub, outbox = asyncio.get_running_loop(), Hub(deliveries), Outbox()
    either: Any = (hub, outbox)
    requests = PendingRequests(ROBOT, either[1], lambda: None, loop.time)
    settings = BridgeSettings(hub=HubSettings(robot=ROBOT), commands=CommandSettings(allowed=("snapshot",)))
    running = asyncio.create_task(CommandConsumer(settings, either[0], requests, loop.time).run())

    async def is_taken() -> bool:
        return requests.has(command_id) or command_id in outbox.ended

    await eventually(is_taken, bool, "it is taken", 10_000)
    at_s = loop.time()
    running.cancel()
    await asyncio.wait({running})
    return at_s, requests, outbox


@in_virtual_time
async def test_what_has_expired_while_the_robot_was_away_keeps_the_next_command_back_for_minutes() -> None:
    old = [command(f"old{number}", age_s=3600) for number in range(500)]
    at_s, requests, outbox = await taken([*old, command("new", age_s=0, expires_after_s=3600)], "new")
    assert at_s < 300
    assert requests.has("new")
    assert requests.denied == 500
    assert set(outbox.ended.values()) == {pb.COMMAND_OUTCOME_EXPIRED}
    assert all(each.acknowledged for each in old)


@in_virtual_time
async def test_strangers_are_answered_no_faster_than_two_a_second() -> None:
    strange = [Delivery("fleet.lab2.cmd.a-b", b"x", NOW_UNIX_S) for _ in range(100)]
    at_s, requests, _ = await taken([*strange, command("new", age_s=0, expires_after_s=600)], "new")
    assert at_s >= (100 - 16) / 2 - 1
    assert (requests.strays, requests.denied) == (100, 0)


@in_virtual_time
async def test_a_command_that_expires_while_it_waits_is_not_handed_over() -> None:
    many = [command(f"c{number}", age_s=0, expires_after_s=30) for number in range(6)]
    _, requests, outbox = await taken(many, "c5")
    assert not requests.has("c5")
    assert outbox.ended["c5"] == pb.COMMAND_OUTCOME_EXPIRED
