"""The preview's switch and profiles, as the keys of a terminal and the controls of a window operate them."""

from dataclasses import dataclass
from typing import Final

from console.client import DesiredPreview, PreviewProfile, PreviewState, PreviewStatus
from console.presentation.severity_style import SeverityStyle

PROFILES: Final = (PreviewProfile.LOW_BW, PreviewProfile.BALANCED, PreviewProfile.HIGH_QUALITY)
"""In the order of the keys 1 to 3."""
SUCCESS_SHOWN_S: Final = 5.0
"""How long the robot's message about a success is shown."""


@dataclass(frozen=True, slots=True)
class Note:
    """A sentence beside the controls."""

    text: str
    style: SeverityStyle


@dataclass(frozen=True, slots=True)
class PreviewSwitch:
    """The switch at one moment.

    Args:
        on: Whether the preview runs, starts or is faulted: the switch then turns it off.
        profile: The one in force, or the one that the switch would request.
    """

    on: bool
    profile: PreviewProfile

    def toggled(self) -> DesiredPreview:
        """Returns the request of the switch."""
        return DesiredPreview(False) if self.on else DesiredPreview(True, self.profile)

    def with_profile(self, profile: PreviewProfile) -> DesiredPreview | None:
        """Returns the request of a profile; None while off: it only selects the next profile."""
        return DesiredPreview(True, profile) if self.on else None


def is_on(preview: PreviewStatus) -> bool:
    """Returns whether the preview runs, starts or is faulted."""
    return preview.state in (PreviewState.RUNNING, PreviewState.STARTING, PreviewState.FAULTED)
