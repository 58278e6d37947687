"""What the drive program is sent when it is connected again: first the stop that it has not confirmed."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from gateway.links.drive.commands import DriveCommands
from omniseer.drive.v1 import drive_pb2 as pb


class Connection:
    """A connection that takes all messages."""

    def __init__(self) -> None:
        self.sent: list[pb.ToDrive] = []

    def send(self, message: pb.ToDrive) -> bool:
        self.sent.append(message)
        return True

    @property
    def stops(self) -> list[str]:
        return [each.stop.by for each in self.sent if each.HasField("stop")]


class Connector:
    """Connects at once."""

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[Connection]:
        yield Connection()


def made() -> DriveCommands:
    connector: Any = Connector()
    return DriveCommands(connector)


def connected(commands: DriveCommands) -> Any:
    return commands.connect()


async def test_a_stop_without_a_connection_is_the_first_message_of_the_next() -> None:
    commands = made()
    assert not commands.stop("anna", "a child"), "it is not on its way"
    async with connected(commands) as connection:
        commands.reset(1)
    assert [each.WhichOneof("message") for each in connection.sent] == ["stop", "reset"]
    assert (connection.sent[0].stop.by, connection.sent[0].stop.reason) == ("anna", "a child")


async def test_of_two_stops_the_newest_is_kept() -> None:
    commands = made()
    commands.stop("anna", "")
    commands.stop("ben", "")
    async with connected(commands) as connection:
        assert connection.stops == ["ben"]


async def test_a_stop_is_sent_on_each_connection_until_it_is_confirmed() -> None:
    commands = made()
    async with connected(commands) as connection:
        assert commands.stop("anna", "")
        assert connection.stops == ["anna"]
    async with connected(commands) as connection:
        assert connection.stops == ["anna"], "the connection broke before the confirmation"
        commands.stop_confirmed()
    async with connected(commands) as connection:
        assert not connection.sent
