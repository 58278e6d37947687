"""A file that is open for reading in chunks, each with its checksum, and may be closed at any time."""

import asyncio
import os
from dataclasses import dataclass
from typing import Final

import google_crc32c

from common.reader_threads import ClosedError, ReaderThreads

CHUNK_BYTES: Final = 240 * 1024
"""Below the 256 KiB that the contract permits: a chunk that a cut connection costs is sent twice, with what
frames it in HTTP/2."""
BLOCK_CHUNKS: Final = 4
"""What one hand-over to a thread reads: each costs some 0.1 ms."""


class UnreadableError(Exception):
    """The disk can't read the file, or reads other bytes than were written."""


@dataclass(frozen=True, slots=True)
class Chunk:
    """Bytes of a file, and their CRC-32C (RFC 3720 B.4)."""

    offset: int
    data: bytes
    crc32c: int


class OpenFile:
    """A file that is open for reading; used on one event loop.

    Args:
        descriptor: belongs to it from now on.
        size: of the file, in bytes.
        threads: that read.
    """

    def __init__(self, descriptor: int, size: int, threads: ReaderThreads) -> None:
        self.size = size
        self._descriptor = descriptor
        self._threads = threads
        self._reading = asyncio.Lock()
        self._closed = False

    @property
    def descriptor(self) -> int:
        """The descriptor, for as long as the file is open.

        Raises:
            ClosedError: it is not.
        """
        if self._closed:
            raise ClosedError
        return self._descriptor

    async def block(self, offset: int, chunk_bytes: int = CHUNK_BYTES) -> list[Chunk]:
        """Returns the next chunks from an offset on; none at the end.

        Raises:
            UnreadableError: the disk can't read them.
            ClosedError: the file has been closed.
        """
        async with self._reading:
            try:
                return await self._threads.run(_block, self.descriptor, offset, self.size, chunk_bytes)
            finally:
                self._give_back()

    def close(self) -> None:
        """Closes the file, after the read that may be under way. Closing it again changes nothing."""
        self._closed = True
        if not self._reading.locked():
            self._give_back()

    def _give_back(self) -> None:
        if self._closed and self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1


def _block(descriptor: int, offset: int, size: int, chunk_bytes: int) -> list[Chunk]:
    block: list[Chunk] = []
    while len(block) < BLOCK_CHUNKS and offset < size:
        data = read_at(descriptor, min(chunk_bytes, size - offset), offset)
        block.append(Chunk(offset, data, int(google_crc32c.value(data))))
        offset += len(data)
    return block


def read_at(descriptor: int, size: int, offset: int) -> bytes:
    """Returns the bytes at an offset: as many as were requested, or fewer.

    Raises:
        UnreadableError: the disk can't read them, or the file ends before.
    """
    try:
        data = os.pread(descriptor, size, offset)
    except OSError as error:
        raise UnreadableError(f"the disk can't read it: {error.strerror}") from error
    if not data:
        raise UnreadableError("it is shorter than it was written")
    return data
