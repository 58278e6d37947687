"""How much something wants to be noticed, in a terminal as in a window."""

from enum import Enum


class Tone(Enum):
    """Colours follow it. The words beside it say the same without colour."""

    GOOD = "good"
    QUIET = "quiet"
    WARNING = "warning"
    BAD = "bad"
