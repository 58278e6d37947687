"""The gateway's end of the connection that carries an export's chunks (common/export_connection.py)."""

import asyncio
import logging
import socket
from collections.abc import AsyncGenerator
from pathlib import Path
from typing import Final

from common.export_connection import LENGTH, MAX_MESSAGE_BYTES

_log = logging.getLogger(__name__)

_LONGEST: Final = max(LENGTH.size, MAX_MESSAGE_BYTES)


async def carried_messages(path: Path, key: bytes) -> AsyncGenerator[bytes]:
    """Yields what a connection to the recorder carries, each message when it is taken, until it ends.

    Ends without a message where the recorder can't be connected to, and with the last whole message where it
    vanishes: the export's call has what is missing, or the reason.

    Args:
        path: where the recorder takes such connections.
        key: of the export.
    """
    loop = asyncio.get_running_loop()
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK) as connected:
        try:
            # A Unix socket connects at once, or not at all (EAGAIN: too many connections wait).
            connected.connect(str(path))
            await loop.sock_sendall(connected, key)
            # One buffer for all: most of a message's cost is memory that is touched for the first time.
            buffer = memoryview(bytearray(_LONGEST))
            while await _fill(connected, buffer[: LENGTH.size]):
                (size,) = LENGTH.unpack(buffer[: LENGTH.size])
                if size > MAX_MESSAGE_BYTES:
                    _log.warning("the recorder announced an export's message of %d bytes; disconnected", size)
                    return
                message = buffer[:size]
                if not await _fill(connected, message):
                    return
                yield bytes(message)
        except OSError as error:
            _log.info("an export's connection to the recorder: %s", error.strerror or error)


async def _fill(connected: socket.socket, room: memoryview) -> bool:
    """Receives as many bytes as there is room for; False if the connection ends before."""
    loop = asyncio.get_running_loop()
    while room:
        try:
            size = connected.recv_into(room)
        except BlockingIOError:
            size = await loop.sock_recv_into(connected, room)
        if not size:
            return False
        room = room[size:]
    return True
