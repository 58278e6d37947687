"""Refused attempts that are told of: whoever tries again and again must not fill a log that has an end. Pure.

Each caller has some free; then one a minute is told of, with the number of those that were left out.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

FREE: Final = 10
EVERY_S: Final = 60.0
"""One more is told of in this time."""
MOST: Final = 256
"""Callers; of more than that, the one that tried longest ago is forgotten."""


@dataclass(slots=True)
class _Caller:
    free: float
    at_s: float
    left_out: int = 0


class Attempts:
    """Belongs to one event loop.

    Args:
        clock: seconds, monotonic.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._callers: dict[str, _Caller] = {}
        """The one that tried last at the end."""

    def __len__(self) -> int:
        return len(self._callers)

    def left_out(self, caller: str) -> int | None:
        """One more attempt.

        Args:
            caller: a name, or where the attempt comes from.

        Returns:
            How many of this caller's were left out since the last one that was told of; None: so is this one.
        """
        now_s = self._clock()
        known = self._callers.pop(caller, None) or _Caller(FREE, now_s)
        self._callers[caller] = known
        if len(self._callers) > MOST:
            del self._callers[next(iter(self._callers))]
        known.free = min(FREE, known.free + (now_s - known.at_s) / EVERY_S)
        known.at_s = now_s
        if known.free < 1:
            known.left_out += 1
            return None
        known.free -= 1
        count, known.left_out = known.left_out, 0
        return count
