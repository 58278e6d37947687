"""How old the picture on the screen is."""

from dataclasses import dataclass

from console.client.results import Freshness, PreviewStatus


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


def reported_age(preview: PreviewStatus) -> PictureAge | None:
    """Returns the largest age that any of the robot's viewers reports; None if none does."""
    measured = preview.measured
    if measured.freshness is not Freshness.FRESH or measured.worst_picture_age_ms is None:
        return None
    return PictureAge(measured.worst_picture_age_ms, cause="oldest of all viewers")
