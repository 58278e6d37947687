"""Whether the base follows another source of commands. Pure.

A multiplexer forwards the source of highest priority and does not report which; only its output shows it.
"""

from collections import deque
from typing import Final

from drive.motion.values import MS, ZERO, Velocity

_JUDGED_AFTER_NS: Final = 300 * MS
"""Motion commanded for so long has reached the output of any working multiplexer."""
_REMEMBERED_NS: Final = 500 * MS
_SAME_MPS: Final = 0.01
_SAME_RAD_S: Final = 0.02


class Outranking:
    """Compares what is published here with what reaches the base.

    Attributes:
        foreign_motion_ns: when motion that was not commanded here last reached the base; 0 before the first.
    """

    def __init__(self) -> None:
        self._published: deque[tuple[int, Velocity]] = deque(maxlen=64)
        self._moving_since_ns: int | None = None
        self._ours_ns = 0
        self.foreign_motion_ns = 0

    def published(self, velocity: Velocity, now_ns: int) -> None:
        """Records a velocity published here."""
        self._published.append((now_ns, velocity))
        if velocity == ZERO:
            self._moving_since_ns = None
        elif self._moving_since_ns is None:
            self._moving_since_ns = now_ns

    def seen(self, velocity: Velocity, now_ns: int) -> None:
        """Records a velocity that reached the base."""
        # The newest first: it is nearly always that one.
        published = reversed(self._published)
        if any(now_ns - at_ns <= _REMEMBERED_NS and _same(ours, velocity) for at_ns, ours in published):
            self._ours_ns = now_ns
        elif not _same(velocity, ZERO):
            self.foreign_motion_ns = now_ns

    def outranked(self, now_ns: int) -> bool:
        """Returns whether another source has the base.

        While motion is commanded here, none of it reaching the base is proof, silence included: a locked
        multiplexer forwards nothing. Otherwise only motion that was not commanded here is.
        """
        if self._moving_since_ns is None:
            return self.foreign_motion_ns > 0 and now_ns - self.foreign_motion_ns <= _JUDGED_AFTER_NS
        since_ns = max(self._moving_since_ns, self._ours_ns)
        return now_ns - since_ns > _JUDGED_AFTER_NS


def _same(one: Velocity, other: Velocity) -> bool:
    return (
        abs(one.vx_mps - other.vx_mps) <= _SAME_MPS
        and abs(one.vy_mps - other.vy_mps) <= _SAME_MPS
        and abs(one.wz_rad_s - other.wz_rad_s) <= _SAME_RAD_S
    )
