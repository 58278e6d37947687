"""Desired and reported state of the preview."""

from dataclasses import dataclass, field
from typing import Final

from gateway.status.preview import (
    Camera,
    Counters,
    Encoder,
    Listener,
    Measurement,
    PreviewState,
    Profile,
    Stream,
)

_ONLY_CAMERA: Final = "camera"
"""What the preview service calls a camera that its configuration gives no name."""


@dataclass(frozen=True, slots=True)
class PreviewSpec:
    """What operators request of the preview.

    Attributes:
        profile: None if none was ever chosen, which an enabled preview always has.
        passphrase: of the session, from enable to disable; empty for a stream that is not encrypted, and
            until the service has reported where its listener is reached.
        camera: empty if none was ever chosen.
    """

    enabled: bool = False
    profile: Profile | None = None
    passphrase: str = field(default="", repr=False)
    camera: str = ""

    def switched(self, *, enabled: bool, profile: Profile | None, camera: str = "") -> "PreviewSpec":
        """Returns the spec of a request after this one.

        Without a profile the present one stays, else BALANCED; without a camera the present one stays.
        """
        camera = camera or self.camera
        profile = profile or self.profile
        if not enabled:
            return PreviewSpec(enabled=False, profile=profile, camera=camera)
        passphrase = self.passphrase if self.enabled else ""
        profile = profile or Profile.BALANCED
        return PreviewSpec(enabled=True, profile=profile, passphrase=passphrase, camera=camera)

    def __str__(self) -> str:
        camera = f", camera {self.camera}" if self.camera not in ("", _ONLY_CAMERA) else ""
        return f"on, {self.profile_name}{camera}" if self.enabled else "off"

    @property
    def profile_name(self) -> str:
        """Name of the profile, for people."""
        return self.profile.value if self.profile else "no profile"


@dataclass(frozen=True, slots=True)
class PreviewReport:
    """Actual state as the preview service reports it. `counters` start at 0 with each `instance_id`."""

    instance_id: str
    applied_revision: int
    state: PreviewState
    profile: Profile | None
    last_error: str
    listener: Listener | None
    stream: Stream | None
    encoder: Encoder | None
    measurement: Measurement | None
    counters: Counters
    wanted_camera: str = ""
    cameras: tuple[Camera, ...] = ()
