"""Many robots in one process: each sends its events one by one, as a bridge does, until the hub has them."""

import asyncio
import itertools
import random
import time
from collections.abc import AsyncGenerator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field

from common.broadcast import Broadcast
from fleet import names
from fleet.connection import FleetAddress, Hub, Start, connect
from fleet.errors import HubError

CONNECTIONS = 8
_ANSWER_S = 5.0
_PAUSE_S = 0.5
_SETTLED_WITHIN_S = 10.0
_PAYLOAD = b"x" * 300
"""Of about the size of an event."""


@dataclass
class Fleet:
    """Robots that share a few connections.

    Args:
        hubs: the connections.
        count: of robots.
        batch: events in one message.
    """

    hubs: Sequence[Hub]
    count: int
    batch: int = 1
    sent: int = field(default=0, init=False)
    """Messages that the hub has."""
    attempts: int = field(default=0, init=False)
    longest_s: float = field(default=0.0, init=False)
    """Longest time from the first attempt at a message until the hub had it."""
    progress: Broadcast = field(default_factory=Broadcast, init=False)

    async def send(self, sequences: range) -> None:
        """Has every robot send its messages of these sequences."""
        async with asyncio.TaskGroup() as tasks:
            for robot in range(self.count):
                tasks.create_task(self._robot(robot, sequences))

    async def sent_at_least(self, messages: int) -> None:
        """Waits until the hub has so many messages."""
        await self.progress.wait_until(lambda: self.sent >= messages)

    async def _robot(self, robot: int, sequences: range) -> None:
        hub = self.hubs[robot % len(self.hubs)]
        for sequence in sequences:
            begun_s = time.monotonic()
            subject = names.event_subject(f"r{robot}", "run", sequence * self.batch)
            while not await self._delivered(hub, subject):
                pass
            self.longest_s = max(self.longest_s, time.monotonic() - begun_s)
            self.sent += 1
            self.progress.notify_all()

    async def _delivered(self, hub: Hub, subject: str) -> bool:
        self.attempts += 1
        try:
            await hub.publish_once(subject, _PAYLOAD * self.batch, _ANSWER_S)
        except HubError:
            # As the bridge: a pause with jitter, so that a fleet does not come back in step.
            await asyncio.sleep(_PAUSE_S * random.uniform(0.5, 1.5))
            return False
        return True


@asynccontextmanager
async def simulated_fleet(address: FleetAddress, count: int, batch: int = 1) -> AsyncGenerator[Fleet, None]:
    """Robots that are connected, for a block; the address speaks for all of them."""
    async with AsyncExitStack() as stack:
        addresses = itertools.repeat(address, CONNECTIONS)
        hubs = [await stack.enter_async_context(connect(address)) for address in addresses]
        for hub in hubs:
            await hub.connected(20)
        yield Fleet(hubs, count, batch)


async def _settled(hub: Hub, expected: int) -> int:
    """The number of messages in the stream. A new leader still has to apply what was acknowledged."""
    deadline = time.monotonic() + _SETTLED_WITHIN_S
    while True:
        try:
            count = int((await hub.api(f"STREAM.INFO.{names.EVENTS}"))["state"]["messages"])
        except HubError:
            count = 0
        if count >= expected or time.monotonic() > deadline:
            return count
        await asyncio.sleep(_PAUSE_S)


@dataclass(frozen=True)
class Received:
    """What the hub has of a fleet."""

    lost: int
    duplicates: int
    disordered: int


async def received(address: FleetAddress, robots: int, messages: int) -> Received:
    """Reads the stream of events, as the administration may, and compares it with what was to be sent."""
    sequences: dict[str, list[int]] = {}
    async with connect(address) as hub:
        await hub.connected(20)
        count = await _settled(hub, robots * messages)
        seen = 0
        follow = hub.follow(names.EVENTS, names.EVENT_SUBJECTS, Start.all())
        while seen < count:
            delivery = await anext(follow)
            seen += 1
            _, robot, _, _, sequence = delivery.subject.split(".")
            sequences.setdefault(robot, []).append(int(sequence))
        await follow.aclose()
    expected = robots * messages
    unique = sum(len(set(each)) for each in sequences.values())
    return Received(
        lost=expected - unique,
        duplicates=sum(len(each) for each in sequences.values()) - unique,
        disordered=sum(each != sorted(each) for each in sequences.values()),
    )
