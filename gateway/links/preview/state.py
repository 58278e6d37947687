"""Desired and reported state of the preview."""

from dataclasses import dataclass, field

from gateway.status.preview import Counters, Encoder, Listener, Measurement, PreviewState, Profile, Stream


@dataclass(frozen=True, slots=True)
class PreviewSpec:
    """What operators request of the preview.

    Attributes:
        profile: None if none was ever chosen, which an enabled preview always has.
        passphrase: of the session, from enable to disable; empty for a stream that is not encrypted, and
            until the service has reported where its listener is reached.
    """

    enabled: bool = False
    profile: Profile | None = None
    passphrase: str = field(default="", repr=False)

    def switched(self, *, enabled: bool, profile: Profile | None) -> "PreviewSpec":
        """Returns the spec of a request after this one.

        Without a profile the present one stays, else BALANCED.
        """
        profile = profile or self.profile
        if not enabled:
            return PreviewSpec(enabled=False, profile=profile)
        passphrase = self.passphrase if self.enabled else ""
        return PreviewSpec(enabled=True, profile=profile or Profile.BALANCED, passphrase=passphrase)

    def __str__(self) -> str:
        return f"on, {self.profile_name}" if self.enabled else "off"

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
