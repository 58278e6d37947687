"""Notifies all waiting tasks of a change, without a queue: a slow task reads the newest state anyway."""

import asyncio
from collections.abc import AsyncGenerator, Callable
from typing import Final

HEARTBEAT_S: Final = 1.0
"""Longest pause between the reports of a service in which nothing changes.

The gateway gives a service up after 2.5 s of silence: two reports in a row may be late, on a busy machine.
"""


def _idle() -> float:
    return HEARTBEAT_S


class Broadcast:
    """A condition variable for the tasks of one event loop, without its lock."""

    def __init__(self) -> None:
        self._event = asyncio.Event()
        self._notified = 0

    def notify_all(self) -> None:
        """Wakes every task in `wait_until`, to check its condition again."""
        self._notified += 1
        self._event.set()
        # The tasks that wait hold the old event; later ones must not be woken by it.
        self._event = asyncio.Event()

    async def wait_until(self, condition: Callable[[], bool], timeout_s: float | None = None) -> bool:
        """Waits until `condition()` holds, evaluated now and after each notification.

        Returns:
            False if `timeout_s` seconds passed first.
        """
        try:
            async with asyncio.timeout(timeout_s):
                while not condition():
                    await self._event.wait()
        except TimeoutError:
            return False
        return True

    async def now_and_on_change(self, heartbeat_s: Callable[[], float] = _idle) -> AsyncGenerator[None]:
        """Yields now, on each notification, and at least every so many seconds, without end.

        Notifications while a turn is used make one turn, the next one.

        Args:
            heartbeat_s: evaluated before each wait.
        """
        while True:
            seen = self._notified
            yield
            await self.wait_until(lambda seen=seen: self._notified != seen, heartbeat_s())  # type: ignore[misc]
