"""The two crossings between the loop and the threads: GStreamer's threads hand over, blocking calls go out.

Everything else in the service runs on the asyncio loop.
"""

import asyncio
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar

T = TypeVar("T")


class Crossing:
    """Hands calls from foreign threads to the loop it was made on."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()

    def hand_over(self, callback: Callable[..., None], *arguments: Any) -> None:
        """Has the loop call `callback` soon. The only thing a streaming thread may do."""
        with suppress(RuntimeError):  # The loop is closed: nobody is left to be told.
            self._loop.call_soon_threadsafe(callback, *arguments)


async def in_thread(work: Callable[[], T], deadline_s: float) -> T:
    """Runs a call that may block, or never return, in a thread of its own.

    Raises:
        TimeoutError: it is not done within `deadline_s`. Its thread stays behind; it does not keep the
            process from ending.
    """
    crossing = Crossing()
    done: asyncio.Future[T] = asyncio.get_running_loop().create_future()

    def settle(result: T | None, error: BaseException | None) -> None:
        if done.done():
            return
        if error is not None:
            done.set_exception(error)
        else:
            done.set_result(result)  # type: ignore[arg-type]  # None only where T allows it

    def run() -> None:
        try:
            result = work()
        except BaseException as error:  # noqa: BLE001  # handed to whoever waits, whatever it is
            crossing.hand_over(settle, None, error)
        else:
            crossing.hand_over(settle, result, None)

    threading.Thread(target=run, name="blocking-call", daemon=True).start()
    return await asyncio.wait_for(done, deadline_s)
