"""The words of the video side: what is wished, what is served, what is measured. Pure and immutable."""

from dataclasses import dataclass, field
from enum import Enum


class Profile(Enum):
    """How much bandwidth the preview may take; the values are the keys of the configuration."""

    LOW_BW = "low_bw"
    BALANCED = "balanced"
    HIGH_QUALITY = "high_quality"


class Codec(Enum):
    """How the pictures are compressed."""

    H264 = "h264"
    H265 = "h265"


@dataclass(frozen=True, slots=True)
class Wish:
    """What the gateway wants.

    Args:
        revision: two wishes with the same revision are the same wish; 0 means that there was none yet.
        enabled: whether there shall be a preview.
        profile: which one; kept while disabled.
        passphrase: SRT passphrase, empty for none. Left out of every textual form.
    """

    revision: int = 0
    enabled: bool = False
    profile: Profile = Profile.BALANCED
    passphrase: str = field(default="", repr=False)


@dataclass(frozen=True, slots=True)
class Target:
    """What a profile means: the pictures, and what the encoder may spend on them.

    Args:
        width_px: picture width in pixels.
        height_px: picture height in pixels.
        fps: pictures per second at most; a slower source is not made faster.
        bitrate_kbps: kbit/s of the compressed video.
        floor_kbps: what the adaptive bit rate never goes below.
    """

    width_px: int
    height_px: int
    fps: int
    bitrate_kbps: int
    floor_kbps: int


@dataclass(frozen=True, slots=True)
class EncoderChoice:
    """The encoder in use and whether it is the one that was wanted; names are the catalogue's.

    Args:
        name: what runs.
        codec: how it compresses.
        hardware: whether dedicated hardware does it.
        wanted: the first choice of the configuration.
        fallback_reason: why the first choice does not run, empty when it does.
    """

    name: str
    codec: Codec
    hardware: bool
    wanted: str
    fallback_reason: str = ""


@dataclass(frozen=True, slots=True)
class Measurement:
    """Figures of the running stream over the last window.

    Args:
        fps: encoded pictures per second.
        bitrate_kbps: of the transport stream.
        viewer_count: connected viewers.
        last_frame_age_ms: age of the newest encoded picture.
        worst_rtt_ms: longest round trip of any viewer, None without viewers.
        worst_loss_percent: largest share of packets that any viewer reported lost, None without viewers.
    """

    fps: float
    bitrate_kbps: float
    viewer_count: int
    last_frame_age_ms: int
    worst_rtt_ms: float | None = None
    worst_loss_percent: float | None = None
