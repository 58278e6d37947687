"""How much longer the processor takes than it can: one that other machines share is slowed down by them.

The kernel counts that time as the program's own. The same Python took 3.5 us at best and 7 us in the median
of two thousand measurements within seconds, on a virtual machine that did nothing else.
"""

import json
import statistics
import time
from typing import Final

from tests.support.undisturbed import DisturbedError

MOST: Final = 1.5
"""By which a figure is divided at most: without a bound, any program would be cheap enough beside others that
are busy enough."""
_AT_ONCE: Final = 20
_ROUND_TRIPS: Final = 500
_VALUE: Final = {"numbers": [1, 2, 3], "text": "x" * 50}


class Slowdown:
    """Compares a fixed piece of work with the fastest that it was done, on a processor of its own."""

    def __init__(self) -> None:
        self._taken_s: list[float] = []

    def sample(self) -> None:
        """Does the work some times, about 60 ms; to be called all along what is measured."""
        self._taken_s += [_work_s() for _ in range(_AT_ONCE)]

    @property
    def factor(self) -> float:
        """The mean duration by the shortest, at least 1."""
        return statistics.fmean(self._taken_s) / min(self._taken_s)

    def at_full_speed(self, counted: float, promised: float) -> float:
        """As the function, by `factor` and MOST."""
        return at_full_speed(counted, promised, self.factor, MOST)


def at_full_speed(counted: float, promised: float, factor: float, most: float) -> float:
    """Returns a counted time, or share, as that of a processor which nothing slows down.

    Args:
        counted: the figure.
        promised: the documented one.
        factor: how much longer the processor takes than it can.
        most: by which the figure is divided at most.

    Raises:
        DisturbedError: divided by `most` it is more than was promised, on a processor slowed down further.
    """
    figure = counted / min(factor, most)
    if figure > promised and factor > most:
        slowed_down = f"by a processor slowed down {factor:.2f} times"
        raise DisturbedError(f"{counted:.4f} was counted, {slowed_down}")
    return figure


def _work_s() -> float:
    began_s = time.thread_time()
    for _ in range(_ROUND_TRIPS):
        json.loads(json.dumps(_VALUE))
    return time.thread_time() - began_s
