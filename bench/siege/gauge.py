"""What a gateway takes of its computer at most."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass

import psutil

_EVERY_S = 0.25


@dataclass
class Peaks:
    """The highest readings.

    Attributes:
        resident_mib: memory in RAM.
        descriptors: open ones.
    """

    resident_mib: float = 0.0
    descriptors: int = 0


@asynccontextmanager
async def gauging(pid: int) -> AsyncIterator[Peaks]:
    """Reads four times a second while the block lasts.

    Raises:
        RuntimeError: when it ends; the program has ended before.
    """
    process, peaks = psutil.Process(pid), Peaks()

    def read() -> None:
        peaks.resident_mib = max(peaks.resident_mib, process.memory_info().rss / 2**20)
        peaks.descriptors = max(peaks.descriptors, process.num_fds())

    async def keep_reading() -> None:
        while True:
            await asyncio.to_thread(read)
            await asyncio.sleep(_EVERY_S)

    reading = asyncio.create_task(keep_reading())
    try:
        yield peaks
    finally:
        reading.cancel()
        # Only the newest reading matters: that of a program that has ended fails like all since.
        await asyncio.gather(reading, return_exceptions=True)
        try:
            await asyncio.to_thread(read)
        except psutil.NoSuchProcess:
            raise RuntimeError("the gateway's program ended amid the siege") from None
