"""Access units that wait for the decoder: a queue that is bounded by time. Pure."""

from collections import deque
from typing import Final

from console.receiver.transport_stream import AccessUnit

_LONGEST_WAIT_S: Final = 0.6
"""As old as pictures may become on a link before the connection is made anew."""
_MOST: Final = 90
"""1.5 s at 60 frames/s. What was held for a lost packet comes at once, so it must be more than that."""


class DecoderQueue:
    """Holds what a decoder has not taken yet.

    A decoder that is too slow for the stream falls behind without end. Once its oldest access unit waits for
    too long, all that follow are refused up to the next key frame. With that it goes on: what still waits
    then is dropped, because nothing depends on it any more.
    """

    def __init__(self) -> None:
        self._waiting: deque[tuple[float, AccessUnit]] = deque()
        self.dropped = 0
        """Access units so far that were refused, or dropped for a key frame."""

    def put(self, unit: AccessUnit, now_s: float) -> bool:
        """Appends an access unit that came at `now_s`; returns whether it was taken."""
        behind = self._is_behind(now_s)
        if behind and not unit.first:
            self.dropped += 1
            return False
        if behind:
            self.clear()
        self._waiting.append((now_s, unit))
        return True

    def take(self) -> tuple[float, AccessUnit] | None:
        """Returns the oldest access unit and when it came; None when none waits."""
        return self._waiting.popleft() if self._waiting else None

    def clear(self) -> None:
        """Drops all that wait."""
        self.dropped += len(self._waiting)
        self._waiting.clear()

    def _is_behind(self, now_s: float) -> bool:
        if len(self._waiting) >= _MOST:
            return True
        return bool(self._waiting) and now_s - self._waiting[0][0] > _LONGEST_WAIT_S
