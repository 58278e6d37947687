"""The hub's clock, by which ages are computed: neither the robots' nor this computer's have to be right."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from fleet.connection import Hub
from fleet.errors import HubError, HubReason
from fleet.names import STATES

_MS_PER_S: Final = 1000


@dataclass(frozen=True, slots=True)
class HubClock:
    """The hub's clock as it was read once; runs on with this computer's monotonic clock.

    Args:
        offset_s: The hub's calendar time minus `monotonic`, in s.
        monotonic: This computer's clock, in s.
    """

    offset_s: float
    monotonic: Callable[[], float] = time.monotonic

    def unix_ms(self) -> int:
        """Returns the present time, in ms since 1970-01-01 UTC."""
        return round((self.monotonic() + self.offset_s) * _MS_PER_S)


async def read_clock(hub: Hub, monotonic: Callable[[], float] = time.monotonic) -> HubClock:
    """Reads the hub's clock, within the time of one answer.

    Servers before 2.10 do not say what time it is: with them, this computer's clock counts.

    Raises:
        HubError: The hub does not answer, or has not been set up.
    """
    answer = await hub.stream_info(f"KV_{STATES}")
    now_s = monotonic()
    if "ts" not in answer:
        return HubClock(time.time() - now_s, monotonic)
    try:
        offset_s = datetime.fromisoformat(str(answer["ts"])).timestamp() - now_s
    except (ValueError, OverflowError) as error:
        raise HubError(HubReason.INVALID, "the hub does not say what time it is") from error
    return HubClock(offset_s, monotonic)
