"""SIGINT (Ctrl-C) and SIGTERM as the ordinary end of a command without an end of its own."""

import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TypeVar

from console.client import Cancelled

ItemT = TypeVar("ItemT")


class Stopped:
    """Whether a signal has come."""

    def __init__(self) -> None:
        self.event = threading.Event()

    def as_end_of(self, items: Iterable[ItemT]) -> Iterator[ItemT]:
        """Yields the items; a stream that the signal cut off ends without an error."""
        try:
            yield from items
        except Cancelled:
            if not self.event.is_set():
                raise


@contextmanager
def until_stopped(cut_off: Callable[[], None]) -> Iterator[Stopped]:
    """Has SIGINT and SIGTERM call `cut_off` instead of ending the program, while the block lasts.

    Args:
        cut_off: Ends the wait of the block. Called in a thread of its own, as the event is set there, because
            a signal handler may run while the block, or the handler of the signal before, holds their locks.
    """
    stopped = Stopped()
    ending = False

    def stop() -> None:
        stopped.event.set()
        cut_off()

    def on_signal(_number: int, _frame: FrameType | None) -> None:
        nonlocal ending
        if not ending:
            ending = True
            threading.Thread(target=stop, name="stop").start()

    before = {number: signal.signal(number, on_signal) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stopped
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
