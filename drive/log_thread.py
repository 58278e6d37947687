"""Logging that never blocks: the lines are written by a thread of their own.

A reader of standard error that stands still (a full disk, a stopped terminal, a stuck log driver) blocks who
writes to it. That must not be what keeps zeros from being published.
"""

import atexit
import logging
import os
import queue
import sys
import threading
from contextlib import suppress
from typing import Final

_MAX_LINES: Final = 1000
_FLUSH_S: Final = 0.5


class LogThread(logging.Handler):
    """Hands lines over to a thread that writes them; drops what finds the queue full.

    Args:
        formatter: of the lines.
        descriptor: they are written to.
    """

    def __init__(self, formatter: logging.Formatter | None, descriptor: int) -> None:
        super().__init__()
        self.setFormatter(formatter)
        self._descriptor = descriptor
        self._lines: queue.Queue[str | None] = queue.Queue(_MAX_LINES)
        self._dropped = 0
        threading.Thread(target=self._run, name="log", daemon=True).start()

    def emit(self, record: logging.LogRecord) -> None:
        """Takes a record; never waits."""
        try:
            self._lines.put_nowait(self.format(record))
        except queue.Full:
            self._dropped += 1

    def drain(self, timeout_s: float) -> int:
        """Waits until everything is written, for at most `timeout_s`; returns how many lines are not."""
        with self._lines.all_tasks_done:
            self._lines.all_tasks_done.wait_for(lambda: not self._lines.unfinished_tasks, timeout_s)
            return self._lines.unfinished_tasks

    def close(self) -> None:
        """Ends the thread, once it has written everything."""
        with suppress(queue.Full):
            self._lines.put_nowait(None)
        super().close()

    def _run(self) -> None:
        while (line := self._lines.get()) is not None:
            dropped, self._dropped = self._dropped, 0
            if dropped:
                line = f"{dropped} lines were dropped: nothing read them\n{line}"
            try:
                # Not by way of sys.stderr: its lock, held while it blocks, would keep the process alive.
                os.write(self._descriptor, f"{line}\n".encode(errors="replace"))
            except OSError:
                self._dropped += 1
            self._lines.task_done()


def log_in_thread() -> None:
    """Replaces the handlers of `common.logs.configure` by one that never blocks."""
    root = logging.getLogger()
    configured = root.handlers[0]
    handler = LogThread(configured.formatter, sys.stderr.fileno())
    for each in configured.filters:
        handler.addFilter(each)
    root.handlers = [handler]
    atexit.register(handler.drain, _FLUSH_S)
