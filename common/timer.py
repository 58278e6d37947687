"""A call on the event loop that is due later, at most once at a time."""

import asyncio
from collections.abc import Callable


class Timer:
    """Calls a function once the time is up, unless it is cancelled or started anew before.

    Args:
        call: on the event loop; must not raise.
    """

    def __init__(self, call: Callable[[], None]) -> None:
        self._call = call
        self._handle: asyncio.TimerHandle | None = None

    def __bool__(self) -> bool:
        """Whether the call is still due."""
        return self._handle is not None

    def start(self, delay_s: float) -> None:
        """Starts it, from now; a call that is due already is replaced."""
        self.cancel()
        self._handle = asyncio.get_running_loop().call_later(delay_s, self._expire)

    def cancel(self) -> bool:
        """Cancels the call; returns whether it was due."""
        handle, self._handle = self._handle, None
        if handle:
            handle.cancel()
        return handle is not None

    def _expire(self) -> None:
        self._handle = None
        self._call()
