"""Everything a pipeline is made of, decided before the first element exists. Pure."""

from dataclasses import dataclass, field, replace

from preview.encoders.catalogue import Encoder
from preview.pipeline.sources import SourcePlan
from preview.values import EncoderChoice, Profile, Target


@dataclass(frozen=True, slots=True)
class ListenerPlan:
    """The SRT listener.

    Args:
        bind: address of this machine.
        port: UDP port.
        latency_ms: SRT latency.
        key_length_bytes: AES key length, where there is a passphrase.
        passphrase: empty for none. Left out of every textual form.
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
        source: how it begins.
        encoder: the catalogue's entry.
        choice: the same for status, with what was wanted.
        profile: in force.
        target: what the profile means.
        highest_kbps: the largest bit rate of all profiles.
        listener: how it ends.
        key_frame_interval_s: longest distance between key frames.
    """

    source: SourcePlan
    encoder: Encoder
    choice: EncoderChoice
    profile: Profile
    target: Target
    highest_kbps: int
    listener: ListenerPlan
    key_frame_interval_s: float

    @property
    def gop_frames(self) -> int:
        """Longest distance between key frames, in frames."""
        return max(1, round(self.key_frame_interval_s * self.target.fps))

    def switched(self, profile: Profile, target: Target) -> "Plan":
        """The same pipeline with another profile."""
        return replace(self, profile=profile, target=target)
