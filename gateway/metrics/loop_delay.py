"""How late the event loop is: what keeps it busy delays every answer by as much."""

import asyncio
import time
from typing import Final, NoReturn

from common.histogram import Histogram

_LOOK_EVERY_S: Final = 0.25
_BOUNDS_S: Final = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0)


class LoopDelay:
    """Sleeps and sees how much too late it wakes."""

    def __init__(self) -> None:
        self.delays = Histogram(_BOUNDS_S)

    async def run(self) -> NoReturn:
        """Until cancelled."""
        while True:
            due_s = time.monotonic() + _LOOK_EVERY_S
            await asyncio.sleep(_LOOK_EVERY_S)
            self.delays.add(max(0.0, time.monotonic() - due_s))
