"""The socket between the gateway and the drive program, by real packets."""

import socket
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from drive.endpoint.endpoint import Endpoint, Peer, Received
from drive.endpoint.wire import MAX_MESSAGE_BYTES, welcome
from drive.motion.machine import Rules
from omniseer.drive.v1 import drive_pb2 as pb


@pytest.fixture
def endpoint(tmp_path: Path) -> Iterator[Endpoint]:
    with Endpoint(tmp_path / "drive.sock", welcome("1", Rules())) as made:
        yield made


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as made:
        yield made


def connect(tmp_path: Path, stack: ExitStack, *, gateway: bool | None) -> socket.socket:
    peer = stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET))
    peer.connect(str(tmp_path / "drive.sock"))
    peer.settimeout(5)
    if gateway is not None:
        peer.send(pb.ToDrive(hello=pb.Hello(gateway=gateway)).SerializeToString())
    return peer


def received(endpoint: Endpoint, looks: int = 4) -> list[Received]:
    return [each for _ in range(looks) for each in endpoint.wait(0)]


STOP = pb.ToDrive(stop=pb.Stop(by="ben"))
GRANT = pb.ToDrive(grant=pb.GrantLease(session_id="s1"))


def test_the_gateway_is_welcomed_and_heard(tmp_path: Path, endpoint: Endpoint, stack: ExitStack) -> None:
    gateway = connect(tmp_path, stack, gateway=True)
    gateway.send(STOP.SerializeToString())
    assert received(endpoint) == [Peer.JOINED, STOP]
    assert pb.FromDrive.FromString(gateway.recv(4096)).welcome.instance_id == "1"


def test_what_a_gateway_said_before_its_end_comes_before_it(
    tmp_path: Path, endpoint: Endpoint, stack: ExitStack
) -> None:
    gateway = connect(tmp_path, stack, gateway=True)
    gateway.send(GRANT.SerializeToString())
    gateway.send(STOP.SerializeToString())
    gateway.close()
    assert received(endpoint) == [Peer.JOINED, GRANT, STOP, Peer.LEFT]
    connect(tmp_path, stack, gateway=True)
    assert received(endpoint) == [Peer.JOINED]


def test_a_second_gateway_is_refused(tmp_path: Path, endpoint: Endpoint, stack: ExitStack) -> None:
    connect(tmp_path, stack, gateway=True)
    second = connect(tmp_path, stack, gateway=True)
    assert received(endpoint) == [Peer.JOINED]
    assert second.recv(4096) == b""


@pytest.mark.parametrize("packet", [STOP.SerializeToString(), b"\xff\xff", b"x" * (MAX_MESSAGE_BYTES + 1)])
def test_an_observer_only_reads(tmp_path: Path, endpoint: Endpoint, stack: ExitStack, packet: bytes) -> None:
    observer = connect(tmp_path, stack, gateway=False)
    assert received(endpoint) == []
    observer.recv(4096)
    observer.send(packet)
    assert received(endpoint) == []
    assert observer.recv(4096) == b""


def test_observers_that_never_leave_do_not_keep_the_gateway_out(
    tmp_path: Path, endpoint: Endpoint, stack: ExitStack
) -> None:
    observers = [connect(tmp_path, stack, gateway=None) for _ in range(12)]
    received(endpoint, looks=40)
    gateway = connect(tmp_path, stack, gateway=True)
    assert received(endpoint) == [Peer.JOINED]
    more = [connect(tmp_path, stack, gateway=False) for _ in range(12)]
    assert Peer.LEFT not in received(endpoint, looks=40)
    gateway.send(STOP.SerializeToString())
    assert received(endpoint) == [STOP]
    del observers, more


def test_a_reader_that_stands_still_delays_nothing(
    tmp_path: Path, endpoint: Endpoint, stack: ExitStack
) -> None:
    connect(tmp_path, stack, gateway=False)
    received(endpoint)
    for _ in range(5000):
        endpoint.send(pb.FromDrive(actual=pb.ActualState(session_id="s" * 100)))
