"""Everything a pipeline is made of, decided before the first element is created. Pure."""

from dataclasses import dataclass, field

from preview.config import PreviewSettings, SrtSettings
from preview.encoders.catalogue import Encoder
from preview.pipeline.sources import SourcePlan
from preview.state.values import DesiredState, EncoderChoice, Profile, Target


@dataclass(frozen=True, slots=True)
class Plan:
    """One pipeline.

    Args:
        settings: of the service.
        source: its first elements: the live camera.
        encoder: entry of the catalogue.
        choice: the encoder and the preferred one, as reported in the status.
        profile: profile in effect.
        passphrase: SRTO_PASSPHRASE, empty for none; None: there is no listener. Excluded from repr.
    """

    settings: PreviewSettings
    source: SourcePlan
    encoder: Encoder
    choice: EncoderChoice
    profile: Profile
    passphrase: str | None = field(repr=False)

    @property
    def target(self) -> Target:
        """Stream parameters of the profile."""
        return self.settings.profiles.targets[self.profile]

    @property
    def srt(self) -> SrtSettings:
        """The last element, the listener."""
        return self.settings.srt

    @property
    def gop_frames(self) -> int:
        """GOP length: the longest distance between key frames, in frames."""
        return max(1, round(self.settings.encoders.key_frame_interval_s * self.target.fps))


def make_plan(
    settings: PreviewSettings,
    desired: DesiredState,
    encoder: Encoder,
    choice: EncoderChoice,
    source: SourcePlan,
) -> Plan:
    """Returns the plan for a desired state, an encoder and a camera."""
    return Plan(settings, source, encoder, choice, desired.profile, desired.session)
