"""The gateway's end of the socket: the newest report counts, every time of motion does, losses are seen."""

import errno
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from gateway.links.drive.wire import DriveClient, DriveConnector
from gateway.links.watch import LinkLostError
from omniseer.drive.v1 import drive_pb2 as pb


class Ends:
    """Both ends of a connection."""

    def __init__(self) -> None:
        self.ours, self.theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.ours.setblocking(False)
        self.episodes: list[tuple[str, Any]] = []
        self.client = DriveClient(self.ours, lambda *ended: self.episodes.append(ended))

    def send(self, message: pb.FromDrive) -> None:
        self.theirs.send(message.SerializeToString())

    def close(self) -> None:
        self.ours.close()
        self.theirs.close()


@pytest.fixture
def ends() -> Iterator[Ends]:
    ends = Ends()
    ends.send(pb.FromDrive(welcome=pb.Welcome(instance_id="process")))
    yield ends
    ends.close()


def report(number: int) -> pb.FromDrive:
    episode = pb.Episode(episode_id=number, ended_ns=number)
    return pb.FromDrive(actual=pb.ActualState(monotonic_ns=number, phase=pb.PHASE_ARMED, episode=episode))


async def test_of_reports_that_come_together_the_newest_counts_and_every_time_of_motion(ends: Ends) -> None:
    for number in (1, 2, 3):
        ends.send(report(number))
    ends.client.read()
    await ends.client.welcomed(1.0)
    assert (await anext(ends.client.reports())).monotonic_ns == 3
    assert [(who, episode.episode_id) for who, episode in ends.episodes] == [
        ("process", 1),
        ("process", 2),
        ("process", 3),
    ]


async def test_a_time_of_motion_is_acknowledged_until_the_drive_program_knows(ends: Ends) -> None:
    ends.theirs.setblocking(False)
    for number, recorded in ((1, None), (2, False), (3, True)):
        message = report(number)
        message.actual.episode.started_ns = 10 * number
        if recorded is not None:
            message.actual.episode.recorded = recorded
        ends.send(message)
    ends.client.read()
    acknowledged = pb.ToDrive.FromString(ends.theirs.recv(1024)).recorded
    assert (acknowledged.episode_id, acknowledged.started_ns) == (2, 20)
    with pytest.raises(BlockingIOError):
        ends.theirs.recv(1024)


async def test_an_end_is_a_loss_after_what_came_before_it(ends: Ends) -> None:
    ends.send(report(1))
    ends.theirs.close()
    ends.client.read()
    reports = ends.client.reports()
    assert (await anext(reports)).monotonic_ns == 1
    with pytest.raises(LinkLostError, match="closed the connection"):
        await anext(reports)
    assert not ends.client.send(pb.ToDrive())


async def test_a_program_that_does_not_read_is_not_waited_for(ends: Ends) -> None:
    stop = pb.ToDrive(stop=pb.Stop(by="anna", reason="x" * 500))
    assert not all(ends.client.send(stop) for _ in range(10_000))
    ends.theirs.recv(16 * 1024)
    assert ends.client.send(stop), "it reads again"


@pytest.mark.parametrize("packet", [b"\xff\xff", report(1).SerializeToString()[:-3] + b"\xff\xff\xff"])
async def test_what_is_no_message_is_a_loss(ends: Ends, packet: bytes) -> None:
    ends.theirs.send(packet)
    ends.client.read()
    with pytest.raises(LinkLostError, match="version"):
        await anext(ends.client.reports())


async def test_without_a_descriptor_for_a_connection_the_link_is_lost_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The defect: the error ended the gateway."""

    def refused(*_: Any) -> socket.socket:
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr(socket, "socket", refused)
    with pytest.raises(LinkLostError) as lost:
        async with DriveConnector(tmp_path / "drive.sock", lambda *_: None).connect():
            pass
    assert "Too many open files" in lost.value.detail
