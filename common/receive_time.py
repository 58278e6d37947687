"""Converts the time of reception that the middleware reports to the monotonic clock."""

import time
from dataclasses import dataclass
from typing import Final

_NS_PER_S: Final = 1e9
_MAX_CLOCK_GAP_S: Final = 50e-6
"""Between reading the two clocks; a larger gap means that the thread was preempted in between."""
_CLOCK_TRIES: Final = 3


@dataclass(frozen=True, slots=True)
class Instant:
    """One instant on both clocks: `monotonic_s` for ages, `system_ns` to compare with stamps."""

    monotonic_s: float
    system_ns: int


def received_at(stamp_ns: int, now: Instant, emptied_at_s: float) -> float:
    """Returns the monotonic seconds of a reception stamped on the system clock.

    Stamp and `now` are of the same clock of the same machine, so their difference is the age of the message,
    unless the clock was set in between. The error is bounded by two certainties: the message was absent when
    the queue was last found empty, at `emptied_at_s`, and is present now. So even a clock that jumps by years
    costs at most one sampling period.
    """
    age_s = (now.system_ns - stamp_ns) / _NS_PER_S
    return min(max(now.monotonic_s - age_s, emptied_at_s), now.monotonic_s)


def present_instant() -> Instant:
    """Reads both clocks as closely together as the scheduler allows: the gap between them is an error."""
    for _ in range(_CLOCK_TRIES):
        now = Instant(time.monotonic(), time.time_ns())
        if time.monotonic() - now.monotonic_s < _MAX_CLOCK_GAP_S:
            break
    return now
