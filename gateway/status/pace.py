"""When each watcher is due: a count of ticks, no clock and no timer.

The status is looked at TICK_MS apart, however many watch. A watcher that wants at most one answer per
interval is due so many ticks after its last one: when something has changed since, or when its ages have not
been told for HEARTBEAT_MS.
"""

from typing import Final

TICK_MS: Final = 50
"""The gateway reads its sources 20 times a second; looking more often would find nothing."""
HEARTBEAT_MS: Final = 1000


class Pace:
    """Of one watcher.

    Args:
        min_interval_ms: the least time between two answers; rounded up to whole ticks.
        now: the tick of its first answer, which is given at once.
        version: of the status in that answer.
    """

    __slots__ = ("_at_least", "_at_most", "_last", "_version")

    def __init__(self, min_interval_ms: int, now: int, version: int) -> None:
        self._at_least = max(1, -(-min_interval_ms // TICK_MS))
        self._at_most = max(HEARTBEAT_MS // TICK_MS, self._at_least)
        self.given(now, version)

    def due(self, now: int, version: int) -> bool:
        """Whether an answer is due at tick `now`, at which the status has this version."""
        passed = now - self._last
        return passed >= self._at_most or (passed >= self._at_least and version != self._version)

    def given(self, now: int, version: int) -> None:
        """An answer of this version left at this tick."""
        self._last = now
        self._version = version
