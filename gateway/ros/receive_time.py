"""Converts the time of reception that the middleware reports to the gateway's monotonic clock."""

from dataclasses import dataclass

_NS_PER_S = 1e9


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
