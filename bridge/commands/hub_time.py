"""How old a command is: by the hub's clock, never by the robot's calendar clock alone. Pure.

The hub stamps a command when its stream takes it, and says what time it is when it is asked (ConsumerInfo.ts
of nats-server 2.10 and later). From the moment of the question the robot counts with a monotonic clock that
goes on in a suspend (CLOCK_BOOTTIME), so the age is rather too high than too low, by a round trip at the
most, and steps of the calendar clock change nothing. A hub that does not say the time leaves the calendar
clock, if the kernel has it synchronised (adjtimex(2)); otherwise the age is in doubt. Nodes of a cluster are
expected to agree on the time.
"""

from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

_MOST_AHEAD_S: Final = 5.0
"""A message from further in the future shows that the clocks can't be compared."""


@dataclass(frozen=True, slots=True)
class HubTime:
    """What the hub's clock showed.

    Attributes:
        unix_s: its answer.
        asked_s: when it was asked; monotonic seconds.
    """

    unix_s: float
    asked_s: float


def hub_time(info: Any, asked_s: float) -> HubTime | None:
    """Returns the time in an answer of the hub; None if there is none.

    Args:
        info: ConsumerInfo of JetStream's API, which may be anything.
        asked_s: when it was requested; monotonic seconds.
    """
    text = info.get("ts") if isinstance(info, dict) else None
    try:
        return HubTime(datetime.fromisoformat(str(text)).timestamp(), asked_s)
    except (ValueError, OverflowError, OSError):
        return None


def age_s(
    taken_unix_s: float, now_s: float, hub: HubTime | None, synchronised_unix_s: float | None
) -> float | None:
    """Returns how old a message is at the most, in seconds; None if that is in doubt.

    Args:
        taken_unix_s: when the stream took it, by the hub's clock.
        now_s: monotonic seconds.
        hub: the hub's newest time, if it says any.
        synchronised_unix_s: the calendar clock; None if it is not synchronised.
    """
    if hub is not None:
        present = hub.unix_s + (now_s - hub.asked_s)
    elif synchronised_unix_s is not None:
        present = synchronised_unix_s
    else:
        return None
    age = present - taken_unix_s
    return max(age, 0.0) if age >= -_MOST_AHEAD_S else None
