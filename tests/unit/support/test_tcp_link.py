"""The bad link for TCP: real connections through it are slow, lossy or silent, as it says."""

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest

from tests.support.tcp_link import TcpLink, needs_tun
from tests.support.udp_link import Impairment

pytestmark = needs_tun
ONE_WAY_S = 0.01
ROUND_TRIPS = 60
RETRANSMITTED_AFTER_S = 0.2
"""Smallest retransmission timeout of Linux (TCP_RTO_MIN)."""


@contextmanager
def echo() -> Iterator[int]:
    """A port that answers one caller with what it says."""
    accepted: list[socket.socket] = []
    with socket.create_server(("", 0)) as listener:

        def answer() -> None:
            caller, _ = listener.accept()
            accepted.append(caller)
            with caller:
                caller.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                while data := caller.recv(1024):
                    caller.sendall(data)

        thread = threading.Thread(target=answer)
        thread.start()
        yield listener.getsockname()[1]
        with suppress(OSError):  # The caller's end may have arrived, or not: the link has gone.
            accepted[0].shutdown(socket.SHUT_RDWR)
        thread.join(10)


@contextmanager
def caller(link: TcpLink) -> Iterator[socket.socket]:
    host, port = link.target.split(":")
    with socket.create_connection((host, int(port)), timeout=10) as made:
        made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        yield made


def round_trip_s(connection: socket.socket) -> float:
    began_s = time.monotonic()
    connection.sendall(b"x")
    assert connection.recv(1024) == b"x"
    return time.monotonic() - began_s


def delayed() -> Impairment:
    return Impairment(delay_s=ONE_WAY_S)


def test_each_way_takes_its_time() -> None:
    with echo() as port, TcpLink(port, delayed(), delayed()) as link, caller(link) as connection:
        assert min(round_trip_s(connection) for _ in range(5)) == pytest.approx(2 * ONE_WAY_S, rel=0.5)


def test_what_is_lost_comes_when_tcp_sends_it_again() -> None:
    with echo() as port, TcpLink(port, delayed(), delayed()) as link, caller(link) as connection:
        link.up.loss = 0.1
        took_s = [round_trip_s(connection) for _ in range(ROUND_TRIPS)]
        assert min(took_s) < RETRANSMITTED_AFTER_S < max(took_s)


@pytest.mark.parametrize("way", ["up", "down"])
def test_one_way_may_fall_silent(way: str) -> None:
    with echo() as port, TcpLink(port) as link, caller(link) as connection:
        round_trip_s(connection)
        getattr(link, way).loss = 1.0
        connection.settimeout(0.1)
        with pytest.raises(TimeoutError):
            round_trip_s(connection)
        connection.settimeout(10)
        link.impair()
        assert connection.recv(1024) == b"x", "sent again"


def test_two_links_at_once() -> None:
    with echo() as one_port, echo() as other_port, TcpLink(one_port) as one, TcpLink(other_port) as other:
        assert one.target.split(":")[0] != other.target.split(":")[0]
        with caller(one) as first, caller(other) as second:
            round_trip_s(first)
            round_trip_s(second)
