"""Measures the delay of the event loop, by which every response is late."""

import asyncio
import time
from typing import Final, NoReturn

from common.histogram import Histogram

_INTERVAL_S: Final = 0.25
_BOUNDS_S: Final = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0)


class LoopDelay:
    """Histogram of how late periodic timers of the loop fire."""

    def __init__(self) -> None:
        self.delays = Histogram(_BOUNDS_S)

    async def run(self) -> NoReturn:
        """Measures until cancelled."""
        while True:
            due_s = time.monotonic() + _INTERVAL_S
            await asyncio.sleep(_INTERVAL_S)
            self.delays.add(max(0.0, time.monotonic() - due_s))
