"""Publishing rates: the default of each topic, and periodic calls that keep to a rate without drift."""

import asyncio
from collections.abc import Callable, Mapping
from typing import Final

from simrobot.behaviour import COMMANDS, Topic

COMMANDS_HZ: Final = 20.0

DEFAULT_RATES_HZ: Final[Mapping[Topic, float]] = {
    Topic.ODOMETRY: 50.0,
    Topic.VISION: 10.0,
    Topic.DETECTIONS: 15.0,
    Topic.BATTERY: 1.0,
    Topic.DIAGNOSTICS: 1.0,
    Topic.MODE: 5.0,
    **dict.fromkeys(COMMANDS, COMMANDS_HZ),
}
"""How often a message is built. Mode and commands are not published while there is nothing to send."""


async def call_at_rate(rate_hz: float, action: Callable[[], None]) -> None:
    """Calls `action` at `rate_hz` until cancelled: call n is due n periods after the first.

    Periods that pass during a call are skipped, not caught up.
    """
    period_s = 1 / rate_hz
    now = asyncio.get_running_loop().time
    start_s, number = now(), 0
    while True:
        action()
        number = max(number + 1, int((now() - start_s) * rate_hz))
        await asyncio.sleep(start_s + number * period_s - now())
