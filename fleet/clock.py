"""The hub's clock, by which ages are computed: neither the robots' nor this computer's have to be right."""

import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from fleet.connection import Hub
from fleet.errors import HubError, HubReason
from fleet.names import STATES

_MS_PER_S: Final = 1000
_FORGOTTEN_AFTER_NS: Final = 5_000_000_000


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

    No call of JetStream's API is for that in all releases from 2.9 on. But the hub says when it has made a
    consumer: one that delivers nothing, and that it forgets by itself.

    Raises:
        HubError: The hub does not answer, or has not been set up.
    """
    name, subjects = secrets.token_hex(8), f"$KV.{STATES}.>"
    config = {
        "name": name,
        "ack_policy": "none",
        "deliver_policy": "new",
        "filter_subject": subjects,
        "inactive_threshold": _FORGOTTEN_AFTER_NS,
        "mem_storage": True,
        "num_replicas": 1,
    }
    stream = f"KV_{STATES}"
    answer = await hub.api(
        f"CONSUMER.CREATE.{stream}.{name}.{subjects}", {"stream_name": stream, "config": config}
    )
    now_s = monotonic()
    try:
        created = datetime.fromisoformat(str(answer["created"]))
        offset_s = created.timestamp() - now_s
    except (KeyError, ValueError, OverflowError) as error:
        raise HubError(HubReason.INVALID, "the hub does not say when it made a consumer") from error
    return HubClock(offset_s, monotonic)
