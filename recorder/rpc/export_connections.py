"""Connections that hand the files of exports to the gateway (common/export_connection.py says how).

What can fail, and what follows:

| failure | follows |
|---|---|
| the socket can't be bound | the log says why; chunks go over gRPC, which is slower |
| the gateway knows nothing of this, does not connect, or can't take a descriptor | chunks go over gRPC |
| something connects with another key, or sends none | disconnected, after CONNECT_WITHIN_S at the latest |
| more of these than MAX_UNKNOWN | the next one is disconnected at once |
| the gateway reads slowly, or not at all | the export waits; it ends with its call, as with gRPC |
| the gateway ends while it reads | so does its call |
"""

import asyncio
import logging
import socket
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Final

from common import bind
from common.deadline import within
from common.errors import UserError
from common.export_connection import CONNECT_WITHIN_S, KEY_BYTES, ORDER, TAKEN, socket_beside
from common.open_file import OpenFile
from common.tasks import cancel

_log = logging.getLogger(__name__)

MAX_UNKNOWN: Final = 16
"""Connections that have not sent a key yet."""
_PAUSE_S: Final = 1.0
"""Before the next attempt to accept a connection, where the process has no descriptor left."""


class ExportConnection:
    """One connection, whose peer has sent the key of an export.

    Args:
        connected: belongs to it from now on.
    """

    def __init__(self, connected: socket.socket) -> None:
        self._socket = connected

    async def hand_over(self, file: OpenFile, offset: int, max_bytes_per_s: int) -> bool:
        """Hands a file over, to be read from an offset on; returns whether the gateway has taken it."""
        try:
            # Nothing has been sent before: there is room for it.
            order = ORDER.pack(offset, file.size, max_bytes_per_s)
            socket.send_fds(self._socket, [order], [file.descriptor])
            return await _received(self._socket, len(TAKEN)) == TAKEN
        except OSError as error:
            _log.info("an export's file can't be handed over: %s", error.strerror or error)
            return False

    async def disconnected(self) -> None:
        """Returns when the gateway has read everything, or is gone."""
        try:
            await _received(self._socket, 1)
        except OSError as error:
            _log.info("an export's connection: %s", error.strerror or error)

    def close(self) -> None:
        """Closes it."""
        self._socket.close()


class ExportConnections:
    """Takes connections for exports that expect one. Used on one event loop."""

    def __init__(self) -> None:
        self._expected: dict[bytes, asyncio.Future[ExportConnection]] = {}
        """By key."""
        self._unknown: set[asyncio.Task[None]] = set()
        self._listens = False

    @asynccontextmanager
    async def listening(self, beside: Path) -> AsyncIterator[None]:
        """Listens until the block ends, unless the socket can't be bound.

        Args:
            beside: the socket on which the recorder serves calls.
        """
        path = socket_beside(beside)
        try:
            listener = bind.stream_socket(path)
        except UserError as error:
            _log.warning("exports will be slower: %s", error)
            yield
            return
        accepting = asyncio.create_task(self._accept(listener), name="connections of exports")
        self._listens = True
        try:
            yield
        finally:
            self._listens = False
            await cancel((accepting, *self._unknown))
            listener.close()
            path.unlink(missing_ok=True)

    @contextmanager
    def expected(self, key: bytes | None) -> Iterator["asyncio.Future[ExportConnection] | None"]:
        """Expects a connection with a key while the block lasts, and closes it when the block ends.

        Yields:
            The connection; None without a key, or where none can come.
        """
        if key is None or not self._listens or key in self._expected:
            yield None
            return
        expected = self._expected[key] = asyncio.get_running_loop().create_future()
        try:
            yield expected
        finally:
            self._expected.pop(key, None)
            if expected.done() and not expected.cancelled():
                expected.result().close()
            expected.cancel()

    async def _accept(self, listener: socket.socket) -> None:
        loop = asyncio.get_running_loop()
        while True:
            try:
                connected, _ = await loop.sock_accept(listener)
            except OSError as error:
                _log.warning("an export's connection can't be accepted: %s", error.strerror)
                await asyncio.sleep(_PAUSE_S)
                continue
            if len(self._unknown) >= MAX_UNKNOWN:
                connected.close()
                continue
            identifying = asyncio.create_task(self._identify(connected), name="an export's key")
            self._unknown.add(identifying)
            identifying.add_done_callback(self._unknown.discard)

    async def _identify(self, connected: socket.socket) -> None:
        """Hands a connection to the export whose key it sends, or closes it."""
        connected.setblocking(False)
        handed_over = False
        try:
            key = await within(CONNECT_WITHIN_S, _received(connected, KEY_BYTES))
            # Once: the key is good for one connection.
            expected = self._expected.pop(key, None)
            if expected and not expected.done():
                expected.set_result(ExportConnection(connected))
                handed_over = True
        except (TimeoutError, OSError):
            pass  # No key: it is closed as one with another key is.
        finally:
            if not handed_over:
                connected.close()


async def _received(connected: socket.socket, size: int) -> bytes:
    """Returns so many bytes, or fewer if the peer disconnects."""
    received = b""
    while len(received) < size:
        more = await asyncio.get_running_loop().sock_recv(connected, size - len(received))
        if not more:
            break
        received += more
    return received
