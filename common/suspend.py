"""Notices a suspend of the computer, in which deadlines on CLOCK_MONOTONIC have stood still."""

import time
from dataclasses import dataclass
from typing import Final, Self

_NS_PER_S: Final = 1_000_000_000
_SUSPENDED_NS: Final = 50_000_000
"""Shorter than any suspend, and than any deadline of driving."""


def elapsed_s() -> float:
    """Returns the seconds of CLOCK_BOOTTIME, which goes on in a suspend, and is never set."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


@dataclass(frozen=True, slots=True)
class _Offset:
    """How far CLOCK_BOOTTIME is ahead of CLOCK_MONOTONIC, which stands still in a suspend (clock_gettime(2)).

    Attributes:
        least_ns, most_ns: bounds; they are apart where the process was interrupted between two readings.
    """

    least_ns: int
    most_ns: int

    @classmethod
    def read(cls) -> Self:
        """Returns the present one."""
        before_ns = time.monotonic_ns()
        boot_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
        return cls(boot_ns - time.monotonic_ns(), boot_ns - before_ns)


class SuspendWatch:
    """Compares the two clocks from call to call.

    A virtual machine that its host pauses is not noticed: all its clocks stand still.
    """

    def __init__(self) -> None:
        self._offset = _Offset.read()

    def resumed(self) -> bool:
        """Returns whether the computer was suspended since the last call."""
        before, self._offset = self._offset, _Offset.read()
        return self._offset.least_ns - before.most_ns > _SUSPENDED_NS


class SuspendedTime:
    """Measures how long the computer has been suspended since this was made."""

    def __init__(self) -> None:
        self._begin = _Offset.read()

    def seconds(self) -> float:
        """Returns the time so far, 0 without a suspend."""
        grown_ns = _Offset.read().least_ns - self._begin.most_ns
        return grown_ns / _NS_PER_S if grown_ns > _SUSPENDED_NS else 0.0
