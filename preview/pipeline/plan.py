"""Everything a pipeline is made of, decided before the first element is created. Pure."""

from dataclasses import dataclass, field, replace

from preview.config import PreviewSettings, SrtSettings
from preview.encoders.catalogue import Encoder
from preview.pipeline import sources
from preview.pipeline.sources import SourcePlan
from preview.values import DesiredState, EncoderChoice, Profile, Target


@dataclass(frozen=True, slots=True)
class Plan:
    """One pipeline.

    Args:
        source: its first elements.
        encoder: entry of the catalogue.
        choice: the encoder and the preferred one, as reported in the status.
        profile: profile in effect.
        target: stream parameters of the profile.
        highest_kbps: highest bit rate of all profiles.
        srt: its last element, the listener.
        passphrase: SRTO_PASSPHRASE, empty for none. Excluded from repr.
        key_frame_interval_s: longest distance between key frames.
        adaptive: whether the bit rate follows the viewers' links.
    """

    source: SourcePlan
    encoder: Encoder
    choice: EncoderChoice
    profile: Profile
    target: Target
    highest_kbps: int
    srt: SrtSettings
    passphrase: str = field(repr=False)
    key_frame_interval_s: float
    adaptive: bool

    @property
    def encrypted(self) -> bool:
        """Whether a viewer needs the passphrase."""
        return bool(self.passphrase)

    @property
    def gop_frames(self) -> int:
        """GOP length: the longest distance between key frames, in frames."""
        return max(1, round(self.key_frame_interval_s * self.target.fps))

    def switched(self, profile: Profile, target: Target) -> "Plan":
        """Returns the plan of the same pipeline with another profile."""
        return replace(self, profile=profile, target=target)


def make_plan(
    settings: PreviewSettings, desired: DesiredState, encoder: Encoder, choice: EncoderChoice
) -> Plan:
    """Returns the plan for a desired state and an encoder.

    Raises:
        UserError: the source can't be used.
    """
    targets = settings.profiles.targets
    return Plan(
        source=sources.plan(settings.source, max(target.fps for target in targets.values())),
        encoder=encoder,
        choice=choice,
        profile=desired.profile,
        target=targets[desired.profile],
        highest_kbps=max(target.bitrate_kbps for target in targets.values()),
        srt=settings.srt,
        passphrase=desired.passphrase,
        key_frame_interval_s=settings.encoders.key_frame_interval_s,
        adaptive=settings.adaptive.enabled,
    )
