"""The two ways between the event loop and other threads.

GStreamer's threads look at the stream, and schedule calls on the loop for what follows; calls that may block
run in a thread of their own. What a thread of SRT must decide by itself, because it can't wait for the loop
(keyframe_gate.py, viewer_limit.py), is under a lock there. Everything else in the service runs on the asyncio
loop.
"""

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from typing import Any, Generic, TypeVar

from common.deadline import within

T = TypeVar("T")


def call_on_loop(loop: asyncio.AbstractEventLoop, callback: Callable[..., None], *arguments: Any) -> None:
    """Schedules a call on the loop, from any thread; ignored when the loop is closed.

    The only thing that a streaming thread may do besides its work on the stream.
    """
    with suppress(RuntimeError):
        loop.call_soon_threadsafe(callback, *arguments)


async def in_thread(work: Callable[[], T], deadline_s: float) -> T:
    """Runs a call that may block, or never return, in a daemon thread of its own, and returns its result.

    Raises:
        TimeoutError: no result within `deadline_s`. The thread is left behind and does not keep the process
            from exiting.
    """
    done = _begin(work)
    del work  # See `_begin`.
    return await within(deadline_s, asyncio.wrap_future(done))


class SharedCall(Generic[T]):
    """A call that may block, or never return, and that is repeated: at most one thread is in it.

    A caller that comes while it runs waits for the same result. With a thread for each attempt, a call that
    hangs would leave one behind with each of them.
    """

    def __init__(self) -> None:
        self._newest: Future[T] | None = None

    async def result(self, work: Callable[[], T], deadline_s: float) -> T:
        """Returns the result of the call that runs, or of a new one.

        Raises:
            TimeoutError: no result within `deadline_s`. The call goes on.
        """
        if self._newest is None or self._newest.done():
            self._newest = _begin(work)
        return await within(deadline_s, asyncio.wrap_future(self._newest))


def _begin(work: Callable[[], T]) -> Future[T]:
    """Begins a call in a daemon thread of its own, and returns its result to come."""
    done: Future[T] = Future()
    done.set_running_or_notify_cancel()  # From here on, giving up does not disturb the thread.

    def run() -> None:
        nonlocal work
        try:
            result = work()
        except BaseException as error:  # noqa: BLE001  # raised again by the awaiting coroutine
            done.set_exception(error)
            return
        # The loop may go on before this thread ends, and what the call references (a listener, which keeps
        # its port) must not outlive the result.
        del work
        done.set_result(result)

    threading.Thread(target=run, name="blocking-call", daemon=True).start()
    return done
