"""The live preview: what it does, where to watch it, how well it runs."""

from dataclasses import dataclass, field
from enum import Enum

from console.client.results.sample import Sample


class PreviewState(Enum):
    """Where the preview is in its life."""

    UNKNOWN = "unknown"
    DISABLED = "disabled"
    RUNNING = "running"
    """Frames leave the robot; a viewer that connects now gets a picture."""
    STARTING = "starting"
    STOPPING = "stopping"
    FAULTED = "faulted"
    """Wanted, but not delivering; `PreviewStatus.last_error` says why. The robot retries by itself."""

    @property
    def settled(self) -> bool:
        """Whether the state stays as it is until somebody asks or something breaks."""
        return self not in (PreviewState.STARTING, PreviewState.STOPPING)


class PreviewProfile(Enum):
    """How much bandwidth the preview may take."""

    UNKNOWN = "unknown"
    """In an answer: none was ever chosen. In a request: keep the current one."""
    LOW_BW = "low-bw"
    BALANCED = "balanced"
    HIGH_QUALITY = "high-quality"


class VideoCodec(Enum):
    """How the pictures are compressed."""

    UNKNOWN = "unknown"
    H264 = "h264"
    H265 = "h265"


class StreamTransport(Enum):
    """How the stream reaches the viewer."""

    UNKNOWN = "unknown"
    SRT = "srt"


class StreamContainer(Enum):
    """What the compressed pictures are packed in."""

    UNKNOWN = "unknown"
    MPEG_TS = "mpeg-ts"


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamEndpoint:
    """Everything a viewer needs to open the stream."""

    transport: StreamTransport
    host: str
    port: int
    """The UDP port the robot listens on while the preview runs."""
    uri: str
    """The whole address, ready for a player; without the passphrase."""
    latency_ms: int
    """The robot's SRT latency. The larger of both sides counts: ask for this value."""
    codec: VideoCodec
    container: StreamContainer
    encrypted: bool
    passphrase: str = field(repr=False)
    """The SRT passphrase. Empty when not encrypted or not for this client. Never logged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Encoder:
    """Which encoder makes the stream, and whether it is the one that was wanted."""

    name: str
    hardware: bool
    wanted: str
    fallback_reason: str
    """Why the wanted one does not run. Empty when it does."""
    codec: VideoCodec


@dataclass(frozen=True, slots=True, kw_only=True)
class VideoFormat:
    """Size and rate of the pictures that the profile asks for."""

    width_px: int
    height_px: int
    fps: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PreviewMeasurement(Sample):
    """Figures taken from the running stream, twice a second."""

    fps: float | None
    bitrate_kbps: float | None
    viewer_count: int | None
    last_frame_age_ms: int | None
    """Age of the newest encoded picture. None before the first one."""
    worst_rtt_ms: float | None
    """Of all viewers. None without viewers."""
    worst_loss_percent: float | None
    """Of all viewers, before retransmission. None without viewers."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PreviewCounters:
    """Event counts since the gateway started."""

    starts: int
    restarts: int
    """Starts by the robot itself after a fault."""
    faults: int
    fallbacks: int
    """Times an encoder was passed over for the next one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PreviewStatus:
    """The live preview as the gateway knows it."""

    state: PreviewState
    profile: PreviewProfile
    """In force, or, while disabled, what the next enable will use."""
    last_error: str
    """What went wrong last and what to do. Empty while it works."""
    endpoint: StreamEndpoint | None
    """None until the preview service has told what it serves."""
    encoder: Encoder | None
    """None while no pipeline exists."""
    video: VideoFormat | None
    """None while no pipeline exists."""
    target_bitrate_kbps: int
    """0 while no pipeline exists."""
    bitrate_reason: str
    """Why the target is what it is, when the robot changed it on its own. Else empty."""
    measured: PreviewMeasurement
    counters: PreviewCounters
    service_reachable: bool
    """Whether the program that makes the video answers the gateway."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PreviewChange:
    """What became of a wish to turn the preview on or off."""

    accepted: bool
    message: str
    preview: PreviewStatus
    """The preview after the request."""
