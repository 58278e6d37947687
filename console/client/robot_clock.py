"""The robot's monotonic clock, as the states of a driver's session show it: never ahead of it. Pure.

A state says when it was made, not how long it was on its way. So the robot's clock shows at least that
instant plus the time since its arrival, and the state with the shortest way gives the best bound. One
that waited behind a lost packet gives a bound that is early by as much: commands that were valid for that
much shorter would stop the robot although they arrive in time.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Final

KEPT_S: Final = 1.0
"""How long a bound counts: longer than any silence that the robot lets a driver go on after (400 ms), and so
short that two quartz clocks differ by less than 0.2 ms."""
_MOST: Final = 128
"""Bounds kept, for twice as many states as all lanes bring within KEPT_S."""
_NS_PER_S: Final = 1_000_000_000


@dataclass(frozen=True, slots=True)
class _Instant:
    monotonic_ns: int
    at_s: float

    def at_ns(self, now_s: float) -> int:
        """Returns what the robot's clock shows at least."""
        return self.monotonic_ns + int((now_s - self.at_s) * _NS_PER_S)


class RobotClock:
    """Takes the instants of states in the order in which they were made.

    Attributes:
        newest_ns: The newest instant, in ns of the robot's clock; 0 before the first.
    """

    def __init__(self) -> None:
        self.newest_ns = 0
        self._newest_at_s = -math.inf
        self._bounds: deque[_Instant] = deque(maxlen=_MOST)
        """The best first; each of the others is the best of those that came after the one before it."""

    def note(self, monotonic_ns: int, at_s: float) -> None:
        """Takes an instant that is newer than all before.

        Args:
            monotonic_ns: On the robot's clock.
            at_s: When it arrived, on the monotonic clock here.
        """
        new = _Instant(monotonic_ns, at_s)
        self.newest_ns, self._newest_at_s = monotonic_ns, at_s
        while self._bounds and self._bounds[-1].at_ns(at_s) <= monotonic_ns:
            self._bounds.pop()
        self._bounds.append(new)
        while at_s - self._bounds[0].at_s > KEPT_S:
            self._bounds.popleft()

    def age_s(self, now_s: float) -> float:
        """Returns the time since the newest arrived; infinite before the first."""
        return now_s - self._newest_at_s

    def at_ns(self, now_s: float) -> int:
        """Returns what the robot's clock shows at least; 0 before the first instant.

        Args:
            now_s: On the monotonic clock here.
        """
        return self._bounds[0].at_ns(now_s) if self._bounds else 0
