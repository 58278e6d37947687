"""The age of the viewers' pictures, as far as it says something of their links. Pure."""

from typing import Final

_COUNTS_S: Final = 3.0
"""As the gateway counts a viewer's report: it may pass an age on for as long."""
_FROZEN_MS: Final = 150.0
"""Less than that the adaptive bit rate does not take for congestion either."""


class PictureAge:
    """The newest age that was reported, unless the robot itself had no newer picture at about that time.

    A camera that stalls, or is changed for another one, makes the pictures of all viewers old, and a lower
    bit rate would not make them younger.
    """

    def __init__(self) -> None:
        self._age_ms = 0
        self._taken_at = float("-inf")
        self._frozen_at = float("-inf")

    def note_newest(self, age_ms: float, now: float) -> None:
        """Notes the age of the newest encoded frame, at monotonic seconds `now`."""
        if age_ms > _FROZEN_MS:
            self._frozen_at = now

    def take(self, age_ms: int, now: float) -> None:
        """Takes the age of the oldest picture that a viewer shows."""
        self._age_ms, self._taken_at = age_ms, now

    def counting(self, now: float) -> int | None:
        """Returns the age that counts; None where none was reported lately, or it says nothing of a link."""
        if now - self._taken_at >= _COUNTS_S or now - self._frozen_at < _COUNTS_S:
            return None
        return self._age_ms
