"""SHA-256 of files: each is read once for as long as it stays the same, at a pace, for all who wait."""

import asyncio
import hashlib
import os
import stat
from collections import OrderedDict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from common.open_file import UnreadableError, read_at
from common.pace import Pace
from common.reader_threads import ReaderThreads

MAX_BYTES_PER_S: Final = 256 * 1024 * 1024
"""Of all files together. A processor with SHA extensions takes 2 GB/s; one without leaves room for others."""
_BLOCK_BYTES: Final = 1024 * 1024
MAX_KNOWN: Final = 150_000
"""More than a run bundle may have: of one that has more, some sums would always be forgotten."""
MAX_BEGUN: Final = 16
"""Files of which a part has been read; beyond that the one that has waited longest is read anew."""


@dataclass(frozen=True, slots=True)
class FileState:
    """A file as it is on the disk; `changed_ns` is its modification time, which stands for its content."""

    path: Path
    size: int
    changed_ns: int


@dataclass(slots=True)
class _Begun:
    """What has been read of a file. The lock is held by the caller who reads on."""

    lock: asyncio.Lock = field(default_factory=asyncio.Lock)
    hash: Any = field(default_factory=hashlib.sha256)
    position: int = 0


class Sums:
    """The sums of files; used on one event loop.

    Reading stops when no one waits for the sum any more; the next request goes on where it stopped.

    Args:
        threads: that read.
        max_bytes_per_s: of all files together.
    """

    def __init__(self, threads: ReaderThreads, max_bytes_per_s: int = MAX_BYTES_PER_S) -> None:
        self._threads = threads
        self._pace = Pace(max_bytes_per_s)
        self._known: OrderedDict[FileState, bytes] = OrderedDict()
        self._begun: OrderedDict[FileState, _Begun] = OrderedDict()

    def known(self, file: FileState) -> bytes | None:
        """Returns the sum of a file, 32 bytes; None while it has not been read."""
        return self._known.get(file)

    async def sha256(self, file: FileState) -> bytes:
        """Returns the sum of a file, 32 bytes; reads it if that has not been done.

        Raises:
            UnreadableError: the disk can't read it, or it has changed.
        """
        begun = self._begun.get(file) or _Begun()
        async with begun.lock:
            known = self.known(file)
            if known is None:
                self._remember_begun(file, begun)
                await self._read_on(file, begun)
                self._begun.pop(file, None)
                known = self._known[file] = begun.hash.digest()
                if len(self._known) > MAX_KNOWN:
                    self._known.popitem(last=False)
        return known

    def _remember_begun(self, file: FileState, begun: _Begun) -> None:
        self._begun[file] = begun
        self._begun.move_to_end(file)
        if len(self._begun) > MAX_BEGUN:
            self._begun.popitem(last=False)

    async def _read_on(self, file: FileState, begun: _Begun) -> None:
        descriptor = await self._threads.opened(open_unchanged, file)
        try:
            while begun.position < file.size:
                size = min(_BLOCK_BYTES, file.size - begun.position)
                await asyncio.sleep(self._pace.delay_s(asyncio.get_running_loop().time(), size))
                await self._threads.run(_take, descriptor, size, begun)
        finally:
            os.close(descriptor)


def state_of(path: Path) -> FileState:
    """Returns a file as it is on the disk. For a thread.

    Raises:
        UnreadableError: it is not there, or no file.
    """
    try:
        found = path.lstat()
    except OSError as error:
        raise _unreadable(error) from error
    if not stat.S_ISREG(found.st_mode):
        raise UnreadableError("it is no file")
    return FileState(path, found.st_size, found.st_mtime_ns)


def open_unchanged(file: FileState) -> int:
    """Opens a file, never through a link, and returns the descriptor. For a thread.

    Raises:
        UnreadableError: the disk can't open it, or it has changed.
    """
    try:
        descriptor = os.open(file.path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError as error:
        raise _unreadable(error) from error
    found = os.fstat(descriptor)
    if (found.st_size, found.st_mtime_ns) != (file.size, file.changed_ns) or not stat.S_ISREG(found.st_mode):
        os.close(descriptor)
        raise UnreadableError("it has changed while it was read")
    return descriptor


def _take(descriptor: int, size: int, begun: _Begun) -> None:
    data = read_at(descriptor, size, begun.position)
    begun.hash.update(data)
    begun.position += len(data)


def _unreadable(error: OSError) -> UnreadableError:
    return UnreadableError(f"the disk can't read it: {error.strerror}")
