"""Everything a pipeline is made of, decided before the first element is created. Pure."""

from dataclasses import dataclass, field, replace

from preview.config import PreviewSettings
from preview.encoders.catalogue import Encoder
from preview.pipeline import sources
from preview.pipeline.sources import SourcePlan
from preview.values import DesiredState, EncoderChoice, Profile, Target


@dataclass(frozen=True, slots=True)
class ListenerPlan:
    """SRT listener.

    Args:
        bind: local address.
        port: UDP port.
        latency_ms: SRTO_LATENCY.
        key_length_bytes: SRTO_PBKEYLEN; applies with a passphrase only.
        passphrase: SRTO_PASSPHRASE, empty for none. Excluded from repr.
    """

    bind: str
    port: int
    latency_ms: int
    key_length_bytes: int = 16
    passphrase: str = field(default="", repr=False)

    @property
    def encrypted(self) -> bool:
        """Whether a viewer needs the passphrase."""
        return bool(self.passphrase)


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
        listener: its last element.
        key_frame_interval_s: longest distance between key frames.
        adaptive: whether the bit rate follows the viewers' links.
    """

    source: SourcePlan
    encoder: Encoder
    choice: EncoderChoice
    profile: Profile
    target: Target
    highest_kbps: int
    listener: ListenerPlan
    key_frame_interval_s: float
    adaptive: bool = False

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
    srt, targets = settings.srt, settings.profiles.targets
    return Plan(
        source=sources.plan(settings.source, max(target.fps for target in targets.values())),
        encoder=encoder,
        choice=choice,
        profile=desired.profile,
        target=targets[desired.profile],
        highest_kbps=max(target.bitrate_kbps for target in targets.values()),
        listener=ListenerPlan(srt.bind, srt.port, srt.latency_ms, srt.key_length_bytes, desired.passphrase),
        key_frame_interval_s=settings.encoders.key_frame_interval_s,
        adaptive=settings.adaptive.enabled,
    )
