"""Notices that a caller connects, beside gRPC, which accepts the connection and does not report it."""

import asyncio
import socket
from collections.abc import Sequence
from contextlib import suppress


async def next_arrival(listening: Sequence[socket.socket], within_s: float) -> None:
    """Returns as soon as a connection waits to be accepted at one of these sockets, or after `within_s`.

    One that is accepted before the event loop has looked goes unnoticed; of a crowd, some do not.
    """
    loop, came = asyncio.get_running_loop(), asyncio.Event()
    for each in listening:
        loop.add_reader(each, came.set)
    try:
        with suppress(TimeoutError):
            async with asyncio.timeout(within_s):
                await came.wait()
    finally:
        for each in listening:
            loop.remove_reader(each)
