"""The live preview: its state, address, encoder and measurements."""

from dataclasses import dataclass, field
from enum import Enum

from console.client.results.sample import Sample


class PreviewState(Enum):
    """State of the preview."""

    UNKNOWN = "unknown"
    DISABLED = "disabled"
    RUNNING = "running"
    """Frames leave the robot; a viewer that connects now receives video."""
    STARTING = "starting"
    STOPPING = "stopping"
    FAULTED = "faulted"
    """Enabled, but without frames; `PreviewStatus.last_error` has the reason. The robot retries."""

    @property
    def settled(self) -> bool:
        """Whether only a request or a fault changes the state."""
        return self not in (PreviewState.STARTING, PreviewState.STOPPING)


class PreviewProfile(Enum):
    """Bandwidth profile of the preview."""

    UNKNOWN = "unknown"
    """In an answer: none was chosen yet. In a request: keep the current one."""
    LOW_BW = "low-bw"
    BALANCED = "balanced"
    HIGH_QUALITY = "high-quality"


class VideoCodec(Enum):
    """Codec of the video."""

    UNKNOWN = "unknown"
    H264 = "h264"
    H265 = "h265"


class StreamTransport(Enum):
    """Transport of the stream."""

    UNKNOWN = "unknown"
    SRT = "srt"


class StreamContainer(Enum):
    """Container of the encoded frames."""

    UNKNOWN = "unknown"
    MPEG_TS = "mpeg-ts"


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamEndpoint:
    """Address and parameters that a viewer needs to open the stream."""

    transport: StreamTransport
    host: str
    port: int
    """The UDP port the robot listens on while the preview runs."""
    uri: str
    """The stream's URI for a player, without the passphrase."""
    latency_ms: int
    """The robot's SRT latency. The larger of both peers' values is in effect."""
    codec: VideoCodec
    container: StreamContainer
    encrypted: bool
    passphrase: str = field(repr=False)
    """The SRT passphrase. Empty when not encrypted or not for this client. Never logged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Encoder:
    """The encoder in use, and the robot's first choice."""

    name: str
    hardware: bool
    wanted: str
    fallback_reason: str
    """Why the first choice (`wanted`) is not in use. Empty when it is."""
    codec: VideoCodec


@dataclass(frozen=True, slots=True, kw_only=True)
class VideoFormat:
    """Frame size and rate of the profile."""

    width_px: int
    height_px: int
    fps: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PreviewMeasurement(Sample):
    """Measurements of the running stream, each over a window of 0.6 s."""

    fps: float | None
    bitrate_kbps: float | None
    viewer_count: int | None
    last_frame_age_ms: int | None
    """Age of the newest encoded frame. None before the first one."""
    worst_rtt_ms: float | None
    """Longest round trip of any viewer. None without viewers."""
    worst_loss_percent: float | None
    """Largest packet loss of any viewer, before retransmission. None without viewers."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PreviewCounters:
    """Counters since the gateway started."""

    starts: int
    restarts: int
    """Starts by the robot itself after a fault."""
    faults: int
    fallbacks: int
    """Times an encoder failed and the next one was used."""
    viewers_refused: int
    """Connections refused because as many viewers as configured were connected."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PreviewStatus:
    """Status of the live preview."""

    state: PreviewState
    profile: PreviewProfile
    """The current one or, while disabled, that of the next start."""
    last_error: str
    """The newest error and its remedy. Empty while the preview works."""
    endpoint: StreamEndpoint | None
    """None until the preview service has reported it."""
    encoder: Encoder | None
    """None while no pipeline exists."""
    video: VideoFormat | None
    """None while no pipeline exists."""
    target_bitrate_kbps: int
    """0 while no pipeline exists."""
    bitrate_reason: str
    """Why the robot has changed the target by itself. Empty while it has not."""
    measured: PreviewMeasurement
    counters: PreviewCounters
    service_reachable: bool
    """Whether the preview service answers the gateway."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PreviewChange:
    """Answer to a preview request."""

    accepted: bool
    message: str
    preview: PreviewStatus
    """The preview after the request."""
