"""A steady beat without drift: the n-th call comes n periods after the first, however long a call takes."""

import asyncio
from collections.abc import Callable


async def beat(rate_hz: float, action: Callable[[], None]) -> None:
    """Calls `action` at `rate_hz` until cancelled. Beats that were missed are left out, not made up for."""
    period_s = 1 / rate_hz
    now = asyncio.get_running_loop().time
    start_s, number = now(), 0
    while True:
        action()
        number = max(number + 1, int((now() - start_s) * rate_hz))
        await asyncio.sleep(start_s + number * period_s - now())
