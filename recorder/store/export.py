"""A final file that is open for a caller, and is verified while it is read."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

from common.open_file import OpenFile, UnreadableError
from common.reader_threads import ClosedError
from recorder.store.readers import Readers
from recorder.store.sums import Sums, open_unchanged, state_of


@dataclass(frozen=True, slots=True)
class Content:
    """A file as it was written. `sha256` has 32 bytes."""

    path: Path
    size: int
    sha256: bytes


class Export:
    """A file that is open for an export, and is verified meanwhile.

    Args:
        content: the file as it was written.
        file: the same, open.
        sum_: of what the disk has.

    Attributes:
        file: the file.
        sha256: that it was written with.
        closed: set once the file is closed.
    """

    def __init__(self, content: Content, file: OpenFile, sum_: "asyncio.Task[bytes]") -> None:
        self.file = file
        self.sha256 = content.sha256
        self.closed = asyncio.Event()
        self._sum = sum_
        self._sum.add_done_callback(_retrieve_error)

    async def verified(self) -> None:
        """Returns once the whole file, also what is not exported of it, has the sum that it was written with.

        Raises:
            UnreadableError: it has another one, or the disk can't read it.
            ClosedError: it was closed meanwhile.
        """
        await asyncio.wait({self._sum})
        if self.closed.is_set():
            raise ClosedError
        if self._sum.result() != self.sha256:
            raise UnreadableError("the disk reads other bytes than were written (SHA-256)")

    def close(self) -> None:
        """Closes the file: nothing more is read of it. Closing it again changes nothing."""
        self.closed.set()
        self._sum.cancel()
        self.file.close()


def _retrieve_error(sum_: "asyncio.Task[bytes]") -> None:
    """Retrieves the error of a sum that outlasts its export: asyncio logs one that is never retrieved."""
    if not sum_.cancelled():
        sum_.exception()


@asynccontextmanager
async def export(content: Content, readers: Readers, sums: Sums) -> AsyncIterator[Export]:
    """Opens a file for an export, until the block ends.

    Raises:
        UnreadableError: the disk can't open it, or it has another size than it was written with.
    """
    state = await readers.files.run(state_of, content.path)
    if state.size != content.size:
        raise UnreadableError("its size on the disk is not the one that was written")
    descriptor = await readers.files.opened(open_unchanged, state)
    file = OpenFile(descriptor, content.size, readers.files)
    exported = Export(content, file, asyncio.create_task(sums.sha256(state), name="sum of an export"))
    try:
        yield exported
    finally:
        exported.close()
