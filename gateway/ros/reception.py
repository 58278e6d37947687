"""When a message was received, on the gateway's monotonic clock."""

from dataclasses import dataclass

_NS_PER_S = 1e9


@dataclass(frozen=True, slots=True)
class Instant:
    """One moment on both clocks: `monotonic_s` for ages, `system_ns` to compare with what ROS stamps."""

    monotonic_s: float
    system_ns: int


def received_at(stamp_ns: int, now: Instant, emptied_at_s: float) -> float:
    """Turns the system-clock stamp of a reception into monotonic seconds.

    The stamp and `now` are of the same clock of the same machine, so their difference is the message's age,
    unless somebody set that clock in between. What we know for certain bounds the error: the message was not
    there when the queue was last found empty, at `emptied_at_s`, and it is here now. So even a clock that
    jumps by years costs at most one sampling period.
    """
    age_s = (now.system_ns - stamp_ns) / _NS_PER_S
    return min(max(now.monotonic_s - age_s, emptied_at_s), now.monotonic_s)
