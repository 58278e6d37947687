"""Threads that read files for callers, so that a program's other work on the disk never waits behind them."""

import asyncio
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Final, ParamSpec, TypeVar

from common.errors import TooMuchError
from common.reasons import Reason

_P = ParamSpec("_P")
_T = TypeVar("_T")

_RETRY_AFTER_S: Final = 1.0
"""Suggested to a caller for whom there is no place left."""


class ClosedError(Exception):
    """What was to be read is closed: there is nothing more to read."""


class ReaderThreads:
    """A few threads and a short queue; used on one event loop.

    Args:
        what: is read, for people and for the threads' names.
        threads: at most.
        most: jobs that run or wait at once; more are refused.
    """

    def __init__(self, what: str, *, threads: int, most: int) -> None:
        self._what = what
        self._most = most
        self._jobs = 0
        self._closed = False
        self._threads = ThreadPoolExecutor(threads, thread_name_prefix=f"reads {what}")

    async def run(self, work: Callable[_P, _T], *args: _P.args, **kwargs: _P.kwargs) -> _T:
        """Runs a job in one of the threads and returns its result.

        When this ends, the job has ended as well, or has not begun: what it uses may be closed. A caller that
        is cancelled therefore waits for a job that runs: jobs are to be short.

        Raises:
            TooMuchError: as many jobs as permitted run or wait.
            ClosedError: the threads have ended.
        """
        if self._closed:
            raise ClosedError
        if self._jobs >= self._most:
            raise TooMuchError(
                f"the robot reads {self._what} for {self._jobs} callers at once, and no more are allowed; "
                "try again in a moment, and ask less often",
                Reason.TOO_MANY_REQUESTS,
                _RETRY_AFTER_S,
            )
        self._jobs += 1
        job = self._threads.submit(work, *args, **kwargs)
        result = asyncio.wrap_future(job)
        try:
            return await asyncio.shield(result)
        except asyncio.CancelledError:
            if not job.cancel():
                await _ended(result)
            raise
        finally:
            self._jobs -= 1

    async def opened(self, work: Callable[_P, int], *args: _P.args, **kwargs: _P.kwargs) -> int:
        """Runs a job that opens a file, as `run` does; returns the descriptor, or closes it when cancelled.

        Raises:
            TooMuchError: see `run`.
        """
        descriptors: list[int] = []

        def keep() -> None:
            descriptors.append(work(*args, **kwargs))

        try:
            await self.run(keep)
        except asyncio.CancelledError:
            for each in descriptors:
                os.close(each)
            raise
        return descriptors[0]

    def close(self) -> None:
        """Ends the threads after the jobs that run; those that wait are cancelled, with their callers."""
        self._closed = True
        self._threads.shutdown(wait=False, cancel_futures=True)


async def _ended(result: "asyncio.Future[_T]") -> None:
    """Waits until a job that runs has ended, however often this task is cancelled meanwhile."""
    while not result.done():
        try:
            await asyncio.wait({result})
        except asyncio.CancelledError:
            continue
    result.exception()  # no caller is left to get it
