"""Calls to the robot that are on their way, each a task of the worker's loop."""

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, Final

_MOST: Final = 4
"""On their way at a time. A further one would say nothing that these do not say already."""


class Calls:
    """A bounded number of calls. Belongs to one loop; its length may be read anywhere.

    Args:
        on_change: called after each beginning and each end; must only hand over.
    """

    def __init__(self, on_change: Callable[[], None]) -> None:
        self._on_change = on_change
        self._tasks: set[asyncio.Task[None]] = set()

    def __len__(self) -> int:
        return len(self._tasks)

    def start(self, call: Callable[[], Coroutine[Any, Any, None]]) -> None:
        """Starts a call, unless four are on their way."""
        if len(self._tasks) < _MOST:
            task = asyncio.create_task(call())
            self._tasks.add(task)
            task.add_done_callback(self._ended)
            self._on_change()

    async def wait(self, timeout_s: float) -> None:
        """Waits for the end of all."""
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=timeout_s)

    def cancel(self) -> None:
        """Cancels all."""
        for task in self._tasks:
            task.cancel()

    def _ended(self, task: "asyncio.Task[None]") -> None:
        self._tasks.discard(task)
        self._on_change()
