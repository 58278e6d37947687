"""An asyncio loop in a thread of its own, which blocking code hands coroutines to."""

import asyncio
import threading
from collections.abc import Coroutine
from concurrent.futures import CancelledError, Future
from typing import Any, TypeVar

from console.client.errors import Cancelled

ResultT = TypeVar("ResultT")


class LoopThread:
    """Runs coroutines of any thread in one loop, until it is stopped."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._running = True
        self._loop: asyncio.AbstractEventLoop
        started = threading.Event()
        # A daemon: a program that forgets to close its client still ends.
        self._thread = threading.Thread(
            target=lambda: asyncio.run(self._main(started)), name="gateway-client", daemon=True
        )
        self._thread.start()
        started.wait()

    def run(self, work: Coroutine[Any, Any, ResultT]) -> ResultT:
        """Returns what the coroutine returns. An exception in the waiting thread (Ctrl-C) cancels it.

        Raises:
            Cancelled: The loop was stopped, before or meanwhile.
        """
        future = self.submit(work)
        try:
            return future.result()
        except CancelledError:
            raise Cancelled("this client was closed") from None
        except BaseException:
            future.cancel()
            raise

    def submit(self, work: Coroutine[Any, Any, ResultT]) -> "Future[ResultT]":
        """Starts the coroutine and does not wait for it.

        Raises:
            Cancelled: The loop was stopped.
        """
        # Under the lock: what is submitted before `stop` is cancelled by it, and nothing comes after.
        with self._lock:
            if self._running:
                return asyncio.run_coroutine_threadsafe(work, self._loop)
        work.close()
        raise Cancelled("this client is closed")

    def stop(self) -> None:
        """Cancels the coroutines under way, ends the loop and joins its thread."""
        with self._lock:
            if self._running:
                self._running = False
                self._loop.call_soon_threadsafe(self._stopping.set)
        # The garbage collector may drop the client in the loop's own thread.
        if threading.current_thread() is not self._thread:
            self._thread.join()

    async def _main(self, started: threading.Event) -> None:
        self._loop = asyncio.get_running_loop()
        self._stopping = asyncio.Event()
        started.set()
        # asyncio.run cancels the remaining tasks and waits for them.
        await self._stopping.wait()
