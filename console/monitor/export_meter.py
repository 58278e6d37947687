"""How fast a copy goes, and when it ends. Pure."""

from collections import deque
from dataclasses import dataclass
from typing import Final

_OVER_S: Final = 5.0
"""The rate is that of the newest seconds."""
_LEAST_BETWEEN_S: Final = 0.2
"""More readings would say no more to a person."""


@dataclass(frozen=True, slots=True)
class ExportRate:
    """A reading.

    Args:
        bytes_per_s: of the newest seconds.
        left_s: until the end at that rate; None while nothing comes.
    """

    bytes_per_s: float = 0.0
    left_s: float | None = None


class ExportMeter:
    """Takes how much there is, as often as it changes."""

    def __init__(self) -> None:
        self._readings: deque[tuple[float, int]] = deque(maxlen=round(_OVER_S / _LEAST_BETWEEN_S))

    def is_due(self, now_s: float) -> bool:
        """Whether the latest reading is old enough for another one."""
        return not self._readings or now_s - self._readings[-1][0] >= _LEAST_BETWEEN_S

    def read(self, now_s: float, done: int, total: int) -> ExportRate:
        """Returns the present rate.

        Args:
            now_s: on the monotonic clock.
            done: bytes that are there.
            total: bytes of all.
        """
        self._readings.append((now_s, done))
        began_s, had = self._readings[0]
        if now_s <= began_s or done <= had:
            return ExportRate()
        bytes_per_s = (done - had) / (now_s - began_s)
        return ExportRate(bytes_per_s, max(0, total - done) / bytes_per_s)
