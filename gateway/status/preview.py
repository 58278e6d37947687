"""The state of the live preview."""

from dataclasses import dataclass, field
from enum import Enum
from typing import Final

from gateway.status.values import Received

_MEASURED_COUNTS_S: Final = 2.5
"""Without a measurement for so long, of two a second, no picture is known to leave."""
_HICCUP_MS: Final = 150.0
"""Cameras pause for several frames, to adjust to the light for example, and are back in time afterwards."""
_MS_PER_S: Final = 1000
_NS_PER_MS: Final = 1_000_000


class PreviewState(Enum):
    """Lifecycle state of the preview."""

    DISABLED = "disabled"
    STARTING = "starting"
    RUNNING = "running"
    STOPPING = "stopping"
    FAULTED = "faulted"


class Profile(Enum):
    """Bandwidth profile of the preview."""

    LOW_BW = "low-bw"
    BALANCED = "balanced"
    HIGH_QUALITY = "high-quality"


class Codec(Enum):
    """Video codec."""

    H264 = "H.264"
    H265 = "H.265"


@dataclass(frozen=True, slots=True)
class Listener:
    """The SRT listener for viewers: UDP port, and latency as SRTO_RCVLATENCY in ms.

    Attributes:
        address: where viewers reach it; empty if an older preview service does not report it.
        capture_offset_ns: of its streams, see StreamEndpoint in the contract; None if it is not reported.
    """

    port: int
    latency_ms: int
    address: str
    capture_offset_ns: int | None = None


@dataclass(frozen=True, slots=True)
class Stream:
    """The stream that the pipeline produces. The codec is None until an encoder is selected."""

    width_px: int
    height_px: int
    fps: float
    target_bitrate_kbps: int
    codec: Codec | None
    encrypted: bool
    bitrate_reason: str


@dataclass(frozen=True, slots=True)
class Encoder:
    """The running encoder, the preferred one, and why that one does not run."""

    name: str
    hardware: bool
    wanted: str
    fallback_reason: str


@dataclass(frozen=True, slots=True)
class Measurement:
    """Measurements of the running stream. The worst values of all viewers are None without viewers."""

    fps: float
    bitrate_kbps: float
    viewer_count: int
    last_frame_age_ms: int
    worst_rtt_ms: float | None
    worst_loss_percent: float | None


@dataclass(frozen=True, slots=True)
class Counters:
    """Monotonic counters since the gateway started."""

    starts: int = 0
    restarts: int = 0
    faults: int = 0
    fallbacks: int = 0
    viewers_refused: int = 0


class CameraState(Enum):
    """What is known of a camera."""

    READY = "ready"
    STARTING = "starting"
    LIVE = "live"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera of the robot.

    Attributes:
        state: None if the preview service reports one that this gateway does not know.
        error: why it has failed and what to do; empty unless it has.
        fallback: name of the camera that takes its place while it fails; empty for none.
    """

    name: str
    state: CameraState | None
    error: str = ""
    fallback: str = ""


def camera_called(name: str, cameras: tuple[Camera, ...]) -> Camera | None:
    """Returns the camera of a name; None if there is none."""
    return next((camera for camera in cameras if camera.name == name), None)


def live_camera(cameras: tuple[Camera, ...]) -> Camera | None:
    """Returns the camera whose frames are the stream's; None if there is none."""
    return next((camera for camera in cameras if camera.state is CameraState.LIVE), None)


@dataclass(frozen=True, slots=True)
class PreviewView:
    """The state of the preview for clients. Any change makes a new object.

    Attributes:
        profile: the one in force, or the one of the next start; None if none was ever selected.
        last_error: the error and its remedy; empty if the preview works.
        listener: None until the preview service has reported it.
        stream: None while no pipeline exists; so is `encoder`.
        measured: None before the first measurement of this run.
        passphrase: of this session; empty if the stream is not encrypted.
        wanted_camera: the one to be live, as far as it works; empty while the service does not answer, or if
            it is older than this gateway. Then there are no `cameras` either.
    """

    state: PreviewState
    profile: Profile | None
    last_error: str
    service_reachable: bool
    listener: Listener | None
    stream: Stream | None
    encoder: Encoder | None
    measured: Received[Measurement] | None
    counters: Counters
    passphrase: str = field(default="", repr=False)
    wanted_camera: str = ""
    cameras: tuple[Camera, ...] = ()

    def newest_capture_ns(self, now_ns: int) -> int | None:
        """Returns an upper bound of when the newest picture that has left by now was captured.

        Pictures have left since the last measurement, which was taken at any moment between two frames: they
        leave at the age that was measured, or at one that is younger by an interval and a hiccup.

        Args:
            now_ns: CLOCK_MONOTONIC, as the bound.

        Returns:
            None while no pictures leave, or none are known to.
        """
        measured = self.measured
        if self.state is not PreviewState.RUNNING or measured is None:
            return None
        if now_ns / 1e9 - measured.at_s > _MEASURED_COUNTS_S:
            return None
        fps, age_ms = measured.value.fps, measured.value.last_frame_age_ms
        slack_ms = _HICCUP_MS + (_MS_PER_S / fps if fps > 0 else 0.0)
        return now_ns - int(max(0.0, age_ms - slack_ms) * _NS_PER_MS)
