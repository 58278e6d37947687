"""Noticing that a caller connects to a socket of which another part of the program accepts."""

import asyncio
import socket
from collections.abc import Iterator

import pytest

from gateway.rpc.connections.arrivals import next_arrival

NEVER_S = 3600.0


@pytest.fixture
def server() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server


async def test_it_returns_when_a_caller_connects(server: socket.socket) -> None:
    waiting = asyncio.create_task(next_arrival([server], NEVER_S))
    await asyncio.sleep(0)
    assert not waiting.done()
    with socket.create_connection(server.getsockname()):
        await waiting


async def test_at_any_of_the_sockets(server: socket.socket) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other, socket.create_connection(server.getsockname()):
        await next_arrival([other, server], NEVER_S)


async def test_without_one_it_returns_after_a_while(server: socket.socket) -> None:
    await next_arrival([server], 0.01)
    await next_arrival([], 0.01)


async def test_it_leaves_nothing_behind(server: socket.socket) -> None:
    await next_arrival([server], 0.01)
    assert not asyncio.get_running_loop().remove_reader(server)
