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
    """

    def __init__(self) -> None:
        self._noted_s: dict[int, float] = {}
        """How late the thread of each processor has run at most."""
        self._due_s: dict[int, float] = {}
        """When each of them is to run next."""
        self._stop = threading.Event()
        self._threads = {
            processor: threading.Thread(
                target=self._look, args=[processor], name=f"stalls-{processor}", daemon=True
            )
            for processor in sorted(os.sched_getaffinity(0))
        }

    @property
    def longest_s(self) -> float:
        """How late a thread has run at most, or is now: who asks may run again before it does."""
        now_s = time.monotonic()
        late_s = [now_s - due_s for due_s in list(self._due_s.values())]
        return max([0.0, *late_s, *list(self._noted_s.values())])

    def __enter__(self) -> Self:
        for processor, thread in self._threads.items():
            # Before it runs: one that does not begin to is late, too.
            self._due_s[processor] = time.monotonic() + _EVERY_S
            thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        for thread in self._threads.values():
            thread.join(_END_S)

    def _look(self, processor: int) -> None:
        try:
            os.sched_setaffinity(0, {processor})  # of this thread
            now_s, stopped = time.monotonic(), False
            while not stopped:
                due_s = self._due_s[processor] = now_s + _EVERY_S
                stopped = self._stop.wait(_EVERY_S)
                now_s = time.monotonic()
                self._noted_s[processor] = max(self._noted_s.get(processor, 0.0), now_s - due_s)
        finally:
            del self._due_s[processor]
