"""One look at the robot, as `robotctl watch` shows it."""

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Final

from console.client import GatewayError, Outage, SystemStatus, WatchedStatus

_MS_PER_S: Final = 1000


@dataclass(frozen=True, slots=True)
class Look:
    """One look at the robot.

    Args:
        status: the newest that was ever received.
        trouble: why this look brought nothing new; None when it did.
        silent_ms: since the newest status came.
    """

    status: SystemStatus
    trouble: GatewayError | None
    silent_ms: int


def looks(
    told: Iterable[WatchedStatus | Outage], clock: Callable[[], float] = time.monotonic
) -> Iterator[Look]:
    """What a stream tells, as looks; it begins with a status."""
    newest: SystemStatus | None = None
    received_s = clock()
    for item in told:
        if isinstance(item, WatchedStatus):
            newest, received_s = item.status, clock()
            yield Look(newest, None, 0)
        elif newest:
            yield Look(newest, item.error, round((clock() - received_s) * _MS_PER_S))
