"""Noticing that a caller connects to a socket of which another part of the program accepts."""

import asyncio
import socket
from collections.abc import Iterator

import pytest

from gateway.rpc.connections.arrivals import Arrivals

NEVER_S = 3600.0


@pytest.fixture
def server() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server


async def test_it_says_so_when_a_caller_connects(server: socket.socket) -> None:
    with Arrivals([server]) as arrivals:
        waiting = asyncio.create_task(arrivals.next(NEVER_S))
        await asyncio.sleep(0)
        assert not waiting.done()
        with socket.create_connection(server.getsockname()):
            assert await waiting


async def test_at_any_of_the_sockets(server: socket.socket) -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as other,
        Arrivals([other, server]) as arrivals,
        socket.create_connection(server.getsockname()),
    ):
        assert await arrivals.next(NEVER_S)


async def test_each_time(server: socket.socket) -> None:
    with Arrivals([server]) as arrivals:
        for _ in range(3):
            with socket.create_connection(server.getsockname()):
                assert await arrivals.next(NEVER_S)
                server.accept()[0].close()


async def test_without_one_it_says_so_after_a_while(server: socket.socket) -> None:
    with Arrivals([server]) as arrivals:
        assert not await arrivals.next(0.01)
    with Arrivals([]) as arrivals:
        assert not await arrivals.next(0.01)


async def test_it_leaves_nothing_behind(server: socket.socket) -> None:
    with Arrivals([server]) as arrivals:
        await arrivals.next(0.01)
    assert not asyncio.get_running_loop().remove_reader(server)
