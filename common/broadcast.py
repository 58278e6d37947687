"""Waking everybody who waits for a change, without a queue: who was busy reads the newest state anyway."""

import asyncio
from collections.abc import Callable


class Broadcast:
    """Belongs to one event loop."""

    def __init__(self) -> None:
        self._event = asyncio.Event()

    def wake_all(self) -> None:
        """Something has changed."""
        self._event.set()
        self._event = asyncio.Event()

    async def wait_until(self, condition: Callable[[], bool], timeout_s: float | None = None) -> bool:
        """Waits until `condition()` holds after a change; False when `timeout_s` went by before it did."""
        try:
            async with asyncio.timeout(timeout_s):
                while not condition():
                    await self._event.wait()
        except TimeoutError:
            return False
        return True
