"""The preview's switch and profiles, as the keys of a terminal and the controls of a window operate them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from console.client import (
    Camera,
    CameraState,
    DesiredPreview,
    PreviewProfile,
    PreviewState,
    PreviewStatus,
)
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
        camera: The one that the switch would request; empty for the robot's own choice.
    """

    on: bool
    profile: PreviewProfile
    camera: str = field(default="", kw_only=True)

    def toggled(self) -> DesiredPreview:
        """Returns the request of the switch."""
        return DesiredPreview(False) if self.on else DesiredPreview(True, self.profile, self.camera)

    def with_profile(self, profile: PreviewProfile) -> DesiredPreview | None:
        """Returns the request of a profile; None while off: it only selects the next profile."""
        return DesiredPreview(True, profile) if self.on else None

    def with_camera(self, camera: str) -> DesiredPreview | None:
        """Returns the request of a camera; None while off: it only selects the next camera."""
        return DesiredPreview(True, camera=camera) if self.on else None


def next_camera(cameras: Sequence[Camera], present: str) -> str:
    """Returns the name of the camera that follows in the robot's order, the first one after the last.

    Args:
        cameras: Those that do not work are passed over.
        present: Name of the one before.

    Returns:
        Empty where there is no other that works.
    """
    names = [each.name for each in cameras]
    begin = names.index(present) + 1 if present in names else 0
    others = [each for each in (*cameras[begin:], *cameras[:begin]) if each.name != present]
    return next((each.name for each in others if each.state is not CameraState.FAILED), "")


def is_on(preview: PreviewStatus) -> bool:
    """Returns whether the preview runs, starts or is faulted."""
    return preview.state in (PreviewState.RUNNING, PreviewState.STARTING, PreviewState.FAULTED)
