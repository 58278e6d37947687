"""How long a thread of this process, which is to run every few milliseconds, did not run."""

import os
import threading
import time
from types import TracebackType
from typing import Final, Self

SPOILT_FROM_S: Final = 0.2
"""From which on a stall may spoil more than it delays: a driver is late then, and the robot stops."""
_EVERY_S: Final = 0.005
_END_S: Final = 10.0


class Stalls:
    """Looks while its block lasts, on each processor.

    What holds up this process holds up whatever a test notes in it, too: the time of an arrival for example.
    Where the host stops a single processor of this virtual machine, it may be a program of the robot that
    stands still.

    Attributes:
        longest_s: how late a thread has run at most.
    """

    def __init__(self) -> None:
        self.longest_s = 0.0
        self._stop = threading.Event()
        self._threads = [
            threading.Thread(target=self._look, args=[processor], name=f"stalls-{processor}", daemon=True)
            for processor in sorted(os.sched_getaffinity(0))
        ]

    def __enter__(self) -> Self:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        for thread in self._threads:
            thread.join(_END_S)

    def _look(self, processor: int) -> None:
        os.sched_setaffinity(0, {processor})  # of this thread
        due_s = time.monotonic() + _EVERY_S
        while not self._stop.wait(_EVERY_S):
            now_s = time.monotonic()
            self.longest_s = max(self.longest_s, now_s - due_s)
            due_s = now_s + _EVERY_S
