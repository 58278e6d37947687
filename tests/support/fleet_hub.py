"""A hub of one real server, set up as `robot-bridge hub init` does, and what robots put into it."""

import asyncio
import json
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from fleet import names
from fleet.connection import FleetAddress, Hub, Start, connect
from hub.jetstream.streams import set_up
from omniseer.fleet.v1.command_pb2 import Command, CommandResult
from omniseer.fleet.v1.event_pb2 import EventBatch
from omniseer.fleet.v1.state_pb2 import RobotState
from omniseer.fleet.v1.upload_pb2 import StoredRecording
from tests.support.fleet_values import subject_of
from tests.support.nats_servers import NatsServers, nats_servers

ResultT = TypeVar("ResultT")
_CONNECTED_WITHIN_S = 10.0


class FleetHub:
    """The hub, from a test without an event loop: each method connects anew.

    Args:
        servers: Its servers.
    """

    def __init__(self, servers: NatsServers) -> None:
        self.servers = servers
        self.urls = ",".join(servers.urls)

    def run(self, work: Callable[[Hub], Awaitable[ResultT]]) -> ResultT:
        """The result of some work with the hub."""

        async def connected() -> ResultT:
            async with connect(FleetAddress(self.servers.urls)) as hub:
                await hub.connected(_CONNECTED_WITHIN_S)
                return await work(hub)

        return asyncio.run(connected())

    def enroll(self, *robots: str, **entry: Any) -> None:
        """Puts robots on the hub's list."""

        async def put(hub: Hub) -> None:
            for robot in robots:
                await hub.put(names.ROBOTS, robot, json.dumps(entry).encode())

        self.run(put)

    def put_state(self, state: RobotState | bytes, robot: str = "") -> None:
        """Puts a robot's state, or any bytes."""
        key, value = (robot, state) if isinstance(state, bytes) else (state.robot, state.SerializeToString())
        self.run(lambda hub: hub.put(names.STATES, key, value))

    def put_events(self, *batches: EventBatch) -> None:
        """Publishes batches of events."""

        async def put(hub: Hub) -> None:
            for batch in batches:
                await hub.publish_once(subject_of(batch), batch.SerializeToString())

        self.run(put)

    def put_bytes(self, subject: str, payload: bytes) -> None:
        """Publishes any bytes to a stream."""
        self.run(lambda hub: hub.publish_once(subject, payload))

    def put_recording(self, robot: str, stored: StoredRecording | bytes, recording_id: str = "") -> None:
        """Puts a recording of the store, or any bytes."""
        value = stored if isinstance(stored, bytes) else stored.SerializeToString()
        key = recording_id if isinstance(stored, bytes) else stored.recording.id
        self.run(lambda hub: hub.put(names.RECORDINGS, f"{robot}.{key}", value))

    async def answer_command(
        self, robot: str, answer: Callable[[Command], CommandResult], listens: Callable[[], None]
    ) -> Command:
        """Waits for a robot's next command, publishes its answer, and returns it.

        Args:
            robot: Whose.
            answer: Makes the answer.
            listens: Called as soon as none is missed any more.
        """
        async with connect(FleetAddress(self.servers.urls)) as hub:
            await hub.connected(_CONNECTED_WITHIN_S)
            # All of them: the stream of a test has no other.
            messages = hub.follow(names.COMMANDS, names.command_subject(robot, "*"), Start.all())
            listens()
            async for message in messages:
                command = Command.FromString(message.payload)
                subject = names.result_subject(robot, command.command_id)
                await hub.publish_once(subject, answer(command).SerializeToString())
                return command
        raise AssertionError("a stream that is followed has no end")


@contextmanager
def fleet_hub(directory: Path) -> Iterator[FleetHub]:
    """Up and set up when the block begins, gone when it ends."""
    with nats_servers(directory) as servers:
        hub = FleetHub(servers)
        hub.run(lambda connection: set_up(connection, replicas=1))
        yield hub
