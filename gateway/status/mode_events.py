"""Derives the events of the robot's mode. Pure."""

from collections.abc import Iterator
from typing import Final

from common.token_bucket import TokenBucket
from gateway.status.event import Event, ModeChanged
from gateway.status.fault import Severity

BURST: Final = 100
"""Events at once, a tenth of the log: no mission has so many phases within minutes."""
SPACING_S: Final = 30.0
"""Beyond them, of one event and the next. Where two programs publish different modes, each look finds another
one for ever: that must not push other events out of the log."""


class ModeEvents:
    """Compares each mode with the one before. A change beyond the limit is counted by the next event."""

    def __init__(self) -> None:
        self._mode = ""
        self._changes = 0
        """Since the newest event."""
        self._bucket = TokenBucket(BURST, 0.0)

    def take(self, mode: str, now_s: float) -> Iterator[Event]:
        """Yields the event that a mode brings, or one that was due; at most one.

        Args:
            mode: empty while the robot reports none.
            now_s: monotonic seconds.
        """
        if mode != self._mode:
            self._mode = mode
            self._changes += 1
        if self._changes and self._bucket.take(now_s, capacity=BURST, refill_per_s=1 / SPACING_S):
            left_out, self._changes = self._changes - 1, 0
            after = f", after {left_out} other change{'' if left_out == 1 else 's'}" if left_out else ""
            sentence = f"robot mode: {mode}{after}"
            yield Event(Severity.INFO, "mission", sentence, ModeChanged(mode), sentence)
