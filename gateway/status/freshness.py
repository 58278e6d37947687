"""Whether a value was ever received, and whether it is too old to rely on."""

from dataclasses import dataclass
from typing import Any, Final, Generic, NamedTuple

from gateway.status.values import Received, ValueT_co


class Freshness(NamedTuple):
    """Availability, staleness and age of a value; `age_ms` is 0 if none was received."""

    available: bool
    stale: bool
    age_ms: int

    @property
    def fresh(self) -> bool:
        """Whether a value was received and is not too old."""
        return self.available and not self.stale


NEVER: Final = Freshness(available=False, stale=False, age_ms=0)


@dataclass(frozen=True, slots=True)
class Sample(Generic[ValueT_co]):
    """A value at one instant; None exactly if it is not available."""

    value: ValueT_co | None
    freshness: Freshness


ABSENT: Final[Sample[Any]] = Sample(None, NEVER)


def age_ms(at_s: float, now_s: float) -> int:
    """Returns the age in ms of what happened at `at_s`, 0 at least.

    Another thread may have stamped it after `now_s` was read.
    """
    return max(0, int((now_s - at_s) * 1000))


def sample(received: Received[ValueT_co] | None, stale_after_ms: int, now_s: float) -> Sample[ValueT_co]:
    """Returns the value at `now_s`; stale if strictly older than `stale_after_ms`."""
    if received is None:
        return ABSENT
    age = age_ms(received.at_s, now_s)
    return Sample(received.value, Freshness(available=True, stale=age > stale_after_ms, age_ms=age))
