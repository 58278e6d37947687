"""The gateway's end of the connection that hands over an export's file (common/export_connection.py)."""

import asyncio
import logging
import os
import socket
import stat
from collections.abc import AsyncIterator
from contextlib import ExitStack, asynccontextmanager
from pathlib import Path

from common.deadline import within
from common.export_connection import CONNECT_WITHIN_S, ORDER, TAKEN
from common.open_file import OpenFile
from common.pace import Pace
from common.reader_threads import ReaderThreads

_log = logging.getLogger(__name__)


class HandedFile:
    """A file that the recorder has handed over.

    Args:
        file: open for reading.
        offset: from where on to read it.
        pace: at which.
        connection: shows the recorder, by being open, that the file is still read.

    Attributes:
        file: the same.
        offset: the same.
        pace: the same.
    """

    def __init__(self, file: OpenFile, offset: int, pace: Pace, connection: socket.socket) -> None:
        self.file = file
        self.offset = offset
        self.pace = pace
        self._connection = connection

    def finish(self) -> None:
        """Closes the connection, by which the recorder sees that everything has been read."""
        self._connection.close()


@asynccontextmanager
async def handed_file(path: Path, key: bytes, threads: ReaderThreads) -> AsyncIterator[HandedFile | None]:
    """Takes the file of an export, and closes it when the block ends.

    Args:
        path: where the recorder takes such connections.
        key: of the export.
        threads: that read the file.

    Yields:
        The file; None where the recorder can't be connected to, or hands none over: the export's call has the
        chunks, or the reason.
    """
    handed = None
    with ExitStack() as opened:
        try:
            handed = await within(CONNECT_WITHIN_S, _handed(path, key, threads, opened))
        except OSError as error:
            _log.info("an export's connection to the recorder: %s", error.strerror or "no answer")
        if handed is None:
            # First: the recorder then knows that its call has to carry the chunks.
            opened.close()
        yield handed


async def _handed(path: Path, key: bytes, threads: ReaderThreads, opened: ExitStack) -> HandedFile | None:
    """Returns the file; None if the recorder hands over none.

    Args:
        path: as of `handed_file`.
        key: the same.
        threads: the same.
        opened: closes what this opens. A cancellation may come with the result, which no caller gets then.
    """
    loop = asyncio.get_running_loop()
    connected = opened.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK))
    # A Unix socket connects at once, or not at all (EAGAIN: too many connections wait).
    connected.connect(str(path))
    await loop.sock_sendall(connected, key)
    await _readable(connected)
    data, descriptors, _, _ = socket.recv_fds(connected, ORDER.size, 1)
    for each in descriptors:
        os.set_inheritable(each, False)  # recv_fds of Python 3.11 takes no flags
    if not (descriptors and len(data) == ORDER.size and stat.S_ISREG(os.fstat(descriptors[0]).st_mode)):
        for each in descriptors:
            os.close(each)
        if data:
            _log.warning("the recorder has handed over no file for an export; disconnected")
        return None
    offset, end, max_bytes_per_s = ORDER.unpack(data)
    file = OpenFile(descriptors[0], end, threads)
    opened.callback(file.close)
    # One byte in an empty buffer never waits.
    connected.send(TAKEN)
    return HandedFile(file, offset, Pace(max_bytes_per_s), connected)


async def _readable(connected: socket.socket) -> None:
    """Returns when there is something to receive, or the connection has ended."""
    loop = asyncio.get_running_loop()
    readable = asyncio.Event()
    loop.add_reader(connected, readable.set)
    try:
        await readable.wait()
    finally:
        loop.remove_reader(connected)
