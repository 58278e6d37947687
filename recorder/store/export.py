"""Reading a final file for a caller: in chunks with their CRC, from an offset, no faster than permitted."""

import asyncio
import hashlib
import os
import threading
from collections.abc import AsyncGenerator, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import google_crc32c

from common.pace import Pace

CHUNK_BYTES: Final = 240 * 1024
"""Below the 256 KiB that the contract permits: a chunk that a cut connection costs is sent twice, with what
frames it in HTTP/2."""
_BLOCK_CHUNKS: Final = 4
"""What one hand-over to a thread reads: each costs some 0.1 ms."""
_CHUNKS_PER_S: Final = 4
"""With a low limit chunks are smaller, so that a caller sees that it goes on."""


class UnreadableError(Exception):
    """The disk can't read the file, or reads other bytes than were written."""


@dataclass(frozen=True, slots=True)
class Content:
    """A file as it was written. `sha256` has 32 bytes."""

    path: Path
    size: int
    sha256: bytes


@dataclass(frozen=True, slots=True)
class Chunk:
    """Bytes of a file, and their CRC-32C (RFC 3720 B.4)."""

    offset: int
    data: bytes
    crc32c: int


async def chunks(
    content: Content, offset: int, paces: tuple[Pace, ...], check: Callable[[], None]
) -> AsyncGenerator[Chunk]:
    """Yields the bytes of a file from an offset on; the next block is read while one leaves.

    The end is withheld until the whole file, the part before the offset included, has the sum that it was
    written with.

    Args:
        content: the file.
        offset: at most its size.
        paces: limits; all of them apply.
        check: called before each block; raises to end the export.

    Raises:
        UnreadableError: see there. What was yielded before may be damaged.
    """
    limits = [pace.bytes_per_s for pace in paces if pace.bytes_per_s]
    size = max(1, min(CHUNK_BYTES, *(limit // _CHUNKS_PER_S for limit in limits))) if limits else CHUNK_BYTES
    loop = asyncio.get_running_loop()
    reader = _Reader(content, offset)
    ahead = loop.run_in_executor(None, reader.read, size)
    try:
        while block := await ahead:
            ahead = loop.run_in_executor(None, reader.read, size)
            for chunk in block:
                check()
                delay_s = max(pace.delay_s(loop.time(), len(chunk.data)) for pace in paces) if paces else 0.0
                if delay_s > 0:
                    await asyncio.sleep(delay_s)
                yield chunk
    finally:
        # What it fails with is of a block that will not be taken.
        ahead.add_done_callback(_forget)
        # By a thread, after the read that may still be under way when the caller has left.
        loop.run_in_executor(None, reader.close)


def _forget(read: "asyncio.Future[list[Chunk]]") -> None:
    """Takes note of the error that a read may have ended with."""
    if not read.cancelled():
        read.exception()


class _Reader:
    """Reads and hashes a file; used by one thread at a time.

    Args:
        content: the file.
        offset: of the first byte that `read` returns.
    """

    def __init__(self, content: Content, offset: int) -> None:
        self._content = content
        self._offset = offset
        self._handle = -1
        self._hash: Any = hashlib.sha256()
        self._position = 0
        self._used = threading.Lock()
        self._closed = False

    def read(self, size: int) -> list[Chunk]:
        """Returns the next chunks of the given size; empty at the end."""
        with self._used:
            if self._handle < 0 and not self._closed:
                self._open()
            return self._read(size)

    def close(self) -> None:
        with self._used:
            self._closed = True
            if self._handle >= 0:
                os.close(self._handle)
                self._handle = -1

    def _open(self) -> None:
        try:
            self._handle = os.open(self._content.path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
            if os.fstat(self._handle).st_size != self._content.size:
                raise UnreadableError("its size on the disk is not the one that was written")
        except OSError as error:
            raise UnreadableError(f"the disk can't read it: {error.strerror}") from error
        while self._position < self._offset:
            self._next(min(CHUNK_BYTES * _BLOCK_CHUNKS, self._offset - self._position))

    def _read(self, size: int) -> list[Chunk]:
        block: list[Chunk] = []
        while len(block) < _BLOCK_CHUNKS and self._position < self._content.size:
            offset = self._position
            data = self._next(min(size, self._content.size - offset))
            block.append(Chunk(offset, data, int(google_crc32c.value(data))))
        if self._position == self._content.size and self._hash.digest() != self._content.sha256:
            raise UnreadableError("the disk reads other bytes than were written (SHA-256)")
        return block

    def _next(self, size: int) -> bytes:
        try:
            data = os.pread(self._handle, size, self._position)
        except OSError as error:
            raise UnreadableError(f"the disk can't read it: {error.strerror}") from error
        if not data:
            raise UnreadableError("it is shorter than it was written")
        self._hash.update(data)
        self._position += len(data)
        return data
