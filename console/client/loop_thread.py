"""An asyncio loop in a thread of its own, which blocking code hands coroutines to.

All blocking clients of a process share one: gRPC keeps each loop that it was used in, also a closed one,
until the process has no channel any more.
"""

import asyncio
import os
import threading
from collections.abc import Coroutine
from concurrent.futures import CancelledError, Future
from typing import Any, Final, TypeVar

from console.client.errors import Cancelled

ResultT = TypeVar("ResultT")


class LoopThread:
    """Runs coroutines of any thread in one loop, until it is stopped."""

    def __init__(self) -> None:
        # Reentrant: the garbage collector may close an abandoned stream, and so submit, within `submit`.
        self._lock = threading.RLock()
        self._pid = os.getpid()
        self._running = True
        self._loop = asyncio.new_event_loop()
        self._stopping = asyncio.Event()
        # A daemon: a program that forgets to close its client still ends.
        self._thread = threading.Thread(target=self._serve, name="gateway-client", daemon=True)
        self._thread.start()

    def run(self, work: Coroutine[Any, Any, ResultT]) -> ResultT:
        """Returns what the coroutine returns. An exception in the waiting thread (Ctrl-C) cancels it.

        Raises:
            Cancelled: The loop was stopped, before or meanwhile; or this is its own thread, as in a garbage
                collection there, which would wait for itself.
        """
        if threading.current_thread() is self._thread:
            work.close()
            raise Cancelled("a blocking call in the client's own thread")
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
            Cancelled: The loop was stopped, or belongs to the process that this one was forked from.
        """
        if os.getpid() != self._pid:
            work.close()
            raise Cancelled("this client belongs to the parent process; make one after the fork")
        # Under the lock: what is submitted before `stop` is cancelled by it, and nothing comes after.
        with self._lock:
            if self._running:
                return asyncio.run_coroutine_threadsafe(work, self._loop)
        work.close()
        raise Cancelled("this client is closed")

    def stop(self) -> None:
        """Cancels the coroutines under way, ends the loop and joins its thread."""
        if os.getpid() != self._pid:
            return
        with self._lock:
            if self._running:
                self._running = False
                self._loop.call_soon_threadsafe(self._stopping.set)
        # The garbage collector may drop the client in the loop's own thread.
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _serve(self) -> None:
        # The runner cancels the remaining tasks and waits for them.
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._stopping.wait())


class SharedLoop:
    """A loop thread that is started for its first user and stopped after the last."""

    def __init__(self) -> None:
        # Reentrant: the garbage collector may release another client's within `acquire`.
        self._lock = threading.RLock()
        self._users = 0
        self._loop: LoopThread | None = None

    def acquire(self) -> LoopThread:
        """Returns the loop; `release` has to follow."""
        with self._lock:
            # Counted first, so that no release meanwhile is the last.
            self._users += 1
            self._loop = self._loop or LoopThread()
            return self._loop

    def release(self, loop: LoopThread) -> None:
        """Stops the loop after its last user; no-op for the loop of a parent process."""
        with self._lock:
            if loop is not self._loop:
                return
            self._users -= 1
            if self._users:
                return
            self._loop = None
        loop.stop()


shared_loop: Final = SharedLoop()
# The parent's thread does not exist in a child, and its lock may be held for ever.
os.register_at_fork(after_in_child=shared_loop.__init__)  # type: ignore[misc]  # on purpose: begins anew
