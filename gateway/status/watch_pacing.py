"""When each watcher of the status is due: a count of ticks, without clock or timer.

At most one snapshot is taken every TICK_MS, however many clients watch; none while no message can be due. A
watcher with a minimum interval is due that many ticks after its last message if the status has changed, and
HEARTBEAT_MS after it in any case, so that its ages stay current.
"""

from typing import Final

TICK_MS: Final = 50
"""The gateway samples its sources 20 times a second; a shorter tick would find nothing new."""
HEARTBEAT_MS: Final = 1000


class WatchPacing:
    """The pacing of one watcher.

    Args:
        min_interval_ms: least time between two messages; rounded up to whole ticks.
        now: the tick of its first message, which is sent at once.
        version: of the status in that message.
    """

    __slots__ = ("_at_least", "_at_most", "_last", "_version")

    def __init__(self, min_interval_ms: int, now: int, version: int) -> None:
        self._at_least = max(1, -(-min_interval_ms // TICK_MS))
        self._at_most = max(HEARTBEAT_MS // TICK_MS, self._at_least)
        self.sent(now, version)

    def may_be_due(self, now: int) -> bool:
        """Returns whether a message can be due at tick `now`, if the status has changed."""
        return now - self._last >= self._at_least

    def due(self, now: int, version: int) -> bool:
        """Returns whether a message is due at tick `now`, at which the status has this version."""
        return now - self._last >= self._at_most or (self.may_be_due(now) and version != self._version)

    def sent(self, now: int, version: int) -> None:
        """Records that a message with this version was sent at this tick."""
        self._last = now
        self._version = version
