"""How old the picture on the screen is."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PictureAge:
    """A reading of the age of the picture on the screen.

    Args:
        age_ms: time since the camera took it.
        error_ms: bound of the reading's error; None where it is unknown.
        cause: the part of the way that takes longest, "link" for example; may be empty.
    """

    age_ms: float
    error_ms: float | None = None
    cause: str = ""
