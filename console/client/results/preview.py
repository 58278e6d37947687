"""The live preview: its state, address, encoder and measurements."""

from dataclasses import dataclass, field
from enum import Enum

from console.capture_time import capture_ns
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


class PictureDelivery(Enum):
    """How a viewer takes the stream."""

    UNKNOWN = "unknown"
    DIRECT = "direct"
    """Packets count as they arrive; only missing ones are waited for."""
    SRT_LATENCY = "srt-latency"
    """Every packet waits for the SRT latency."""


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
    capture_offset_ns: int | None = None
    """Capture time on the robot's monotonic clock minus PTS. None where PTS does not say."""

    def captured_ns(self, pts: int, robot_now_ns: int) -> int | None:
        """Returns when a picture was captured, in ns on the robot's monotonic clock.

        Args:
            pts: Its PTS in the transport stream, in ticks of 90 kHz; 33 bits, so that it wraps every 26.5 h.
            robot_now_ns: The present time on that clock (`Clock`); half a wrap of error does no harm.

        Returns:
            None where PTS does not say.
        """
        if self.capture_offset_ns is None:
            return None
        return capture_ns(pts, self.capture_offset_ns, robot_now_ns)


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
    worst_picture_age_ms: int | None
    """Largest age, from capture to the screen, that any viewer reports of its picture. None if none does."""
    reporting_viewer_count: int | None
    """Viewers that report the picture they show."""
    direct_viewer_count: int | None
    """Viewers of these that take packets as they arrive."""
    srt_latency_viewer_count: int | None
    """Viewers of these that wait for the SRT latency, and so see every picture later by that much."""
    most_packets_given_up: int | None
    """The most packets that one of these viewers has given up since it connected. None if none reports."""


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


class CameraState(Enum):
    """What is known of a camera. None is opened to find out."""

    UNKNOWN = "unknown"
    READY = "ready"
    """It is there, and delivered when it was last used, or has not been used yet."""
    STARTING = "starting"
    """It is being started, to become the live one."""
    LIVE = "live"
    """Its frames are the stream's."""
    FAILED = "failed"
    """It is missing, or failed when it was last used; `Camera.error` has the reason."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """A camera of the robot, or another source of video."""

    name: str
    state: CameraState
    error: str
    """Why it has failed, and the remedy. Empty unless it has."""
    fallback: str
    """Name of the camera that takes its place while it fails. Empty for none."""


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
    wanted_camera: str = ""
    """Name of the camera that was chosen last; live as far as it works. Empty for robots older than this."""
    cameras: tuple[Camera, ...] = ()
    """In the order of the robot's configuration; at most one is LIVE."""

    def camera(self, name: str) -> Camera | None:
        """Returns the camera of a name; None if there is none."""
        return next((camera for camera in self.cameras if camera.name == name), None)

    @property
    def live_camera(self) -> Camera | None:
        """The camera whose frames are the stream's; None while there is none, or the robot does not say."""
        return next((camera for camera in self.cameras if camera.state is CameraState.LIVE), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class PreviewChange:
    """Answer to a preview request."""

    accepted: bool
    message: str
    preview: PreviewStatus
    """The preview after the request."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyFrameAnswer:
    """Answer to a request for a key frame."""

    forced: bool
    """Whether one is forced for this request. False: one that is on its way serves it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureReport:
    """The picture that a viewer shows at this moment, as it reports it to the robot."""

    viewer_id: str = ""
    """The viewer among those of this caller, up to 64 printable ASCII characters. Empty for the only one."""
    picture_age_ms: int
    """From capture to now, at most a minute."""
    picture_age_error_ms: int = 0
    """Bound of that age's error."""
    rtt_ms: int | None = None
    """Round-trip time of the stream's connection. None if unknown; the same for `loss_percent`."""
    loss_percent: float | None = None
    """Share of packets lost lately, before retransmission."""
    packets_held: int = 0
    """Packets that waited for a missing one before them, since the viewer connected."""
    packets_given_up: int = 0
    """Packets that were given up, since the viewer connected."""
    delivery: PictureDelivery = PictureDelivery.UNKNOWN
    link_age_ms: int | None = None
    """`picture_age_ms` without the time that pictures waited on this computer. None if unknown."""
