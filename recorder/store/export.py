"""Reading a final file for a caller: in chunks with their CRC, from an offset, no faster than permitted."""

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from common.open_file import CHUNK_BYTES, Chunk, ClosedError, OpenFile, UnreadableError
from common.pace import Pace
from common.tasks import cancel
from recorder.store.readers import Readers
from recorder.store.sums import Sums, open_unchanged, state_of

_CHUNKS_PER_S: Final = 4
"""With a low limit chunks are smaller, so that a caller sees that it goes on."""


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
        self._sum.add_done_callback(_forget)

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


def _forget(sum_: "asyncio.Task[bytes]") -> None:
    """Takes note of the error that the sum of an export may have ended with that is over."""
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


async def chunks(exported: Export, offset: int, paces: tuple[Pace, ...]) -> AsyncGenerator[Chunk]:
    """Yields the bytes of a file from an offset on; the next block is read while one leaves.

    The last block is withheld until the file is verified.

    Args:
        exported: the file.
        offset: at most its size.
        paces: limits; all of them apply.

    Raises:
        UnreadableError: see there. What was yielded before may be damaged.
        ClosedError: the file was closed meanwhile.
    """
    limits = [pace.bytes_per_s for pace in paces if pace.bytes_per_s]
    size = max(1, min(CHUNK_BYTES, *(limit // _CHUNKS_PER_S for limit in limits))) if limits else CHUNK_BYTES
    file, loop = exported.file, asyncio.get_running_loop()
    ahead = asyncio.create_task(file.block(offset, size))
    try:
        while block := await ahead:
            end = block[-1].offset + len(block[-1].data)
            ahead = asyncio.create_task(file.block(end, size))
            if end == file.size:
                await exported.verified()
            for chunk in block:
                delay_s = max(pace.delay_s(loop.time(), len(chunk.data)) for pace in paces) if paces else 0.0
                if delay_s > 0:
                    await asyncio.sleep(delay_s)
                yield chunk
        await exported.verified()
    finally:
        await cancel([ahead])
