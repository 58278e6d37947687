"""Chunks of an open file, in order, no faster than permitted, and the end only once it may leave."""

import asyncio
from collections.abc import AsyncGenerator, Awaitable, Callable, Sequence
from typing import Final

from common.open_file import CHUNK_BYTES, Chunk, OpenFile
from common.pace import Pace
from common.tasks import cancel

_CHUNKS_PER_S: Final = 4
"""With a low limit chunks are smaller, so that a caller sees that it goes on."""


async def paced_chunks(
    file: OpenFile, offset: int, paces: Sequence[Pace], before_end: Callable[[], Awaitable[object]]
) -> AsyncGenerator[Chunk]:
    """Yields the bytes of a file from an offset on; the next block is read while one leaves.

    Args:
        file: the file.
        offset: at most its size.
        paces: limits; all of them apply.
        before_end: awaited once everything is read, before the last block leaves; raises to withhold it.

    Raises:
        UnreadableError: the disk can't read the file.
        ClosedError: the file was closed meanwhile.
    """
    limits = [pace.bytes_per_s for pace in paces if pace.bytes_per_s]
    size = max(1, min(CHUNK_BYTES, *(limit // _CHUNKS_PER_S for limit in limits))) if limits else CHUNK_BYTES
    loop = asyncio.get_running_loop()
    ahead = asyncio.create_task(file.block(offset, size))
    try:
        while block := await ahead:
            offset = block[-1].offset + len(block[-1].data)
            if offset == file.size:
                await before_end()
            else:
                ahead = asyncio.create_task(file.block(offset, size))
            for chunk in block:
                delay_s = max((pace.delay_s(loop.time(), len(chunk.data)) for pace in paces), default=0.0)
                if delay_s > 0:
                    await asyncio.sleep(delay_s)
                yield chunk
            if offset == file.size:
                return
        await before_end()
    finally:
        await cancel([ahead])
