"""Immutable values of the preview service: desired state, actual state, stream parameters. Pure."""

from dataclasses import dataclass, field
from enum import Enum
from typing import Final

from preview.state.cameras import Camera
from preview.state.lifecycle import Counters, Reason, State

CAPTURE_OFFSET_NS: Final = -3_600 * 1_000_000_000
"""Capture time on CLOCK_MONOTONIC minus PTS: mpegtsmux adds an hour (TS_MUX_CLOCK_BASE), so that no DTS is
negative. pipeline/capture_clock.py makes it true."""


class Profile(Enum):
    """Bandwidth profile, spelled as for operators."""

    LOW_BW = "low-bw"
    BALANCED = "balanced"
    HIGH_QUALITY = "high-quality"


class Codec(Enum):
    """Video coding standard: ITU-T H.264 or H.265."""

    H264 = "h264"
    H265 = "h265"


@dataclass(frozen=True, slots=True)
class DesiredState:
    """State that the gateway requests.

    Args:
        revision: identifies the request; the same revision again is the same request. 0: none yet.
        enabled: whether the preview is to run.
        profile: bandwidth profile; kept while disabled.
        passphrase: SRT passphrase (SRTO_PASSPHRASE), empty for none. Excluded from repr.
        camera: name of the camera to be live; kept while disabled. Empty: the one before it, at first the
            configuration's first.
    """

    revision: int = 0
    enabled: bool = False
    profile: Profile = Profile.BALANCED
    passphrase: str = field(default="", repr=False)
    camera: str = ""

    @property
    def session(self) -> str | None:
        """The passphrase of the listener; None: there is to be no listener."""
        return self.passphrase if self.enabled else None


@dataclass(frozen=True, slots=True)
class Target:
    """Stream parameters of a profile.

    Args:
        width_px: frame width in pixels.
        height_px: frame height in pixels.
        fps: upper limit in frames per second; a slower source is not sped up.
        bitrate_kbps: kbit/s of the elementary stream.
        floor_kbps: lower limit of the adaptive bit rate.
    """

    width_px: int
    height_px: int
    fps: int
    bitrate_kbps: int
    floor_kbps: int


@dataclass(frozen=True, slots=True)
class EncoderChoice:
    """Encoder in use and the one preferred by the configuration, by their names in the catalogue.

    Args:
        name: encoder in use.
        hardware: whether it is dedicated hardware.
        wanted: first choice of the configuration.
        fallback_reason: why the first choice is not in use; empty when it is.
    """

    name: str
    hardware: bool
    wanted: str
    fallback_reason: str = ""


@dataclass(frozen=True, slots=True)
class StreamState:
    """Parameters of the stream being served.

    Args:
        target: frame size, frame rate and the profile's own bit rate.
        bitrate_kbps: bit rate that the encoder is set to.
        bitrate_reason: why it differs from the profile's own; empty when it does not.
        codec: video coding standard.
        encrypted: whether the listener requires a passphrase.
    """

    target: Target
    bitrate_kbps: int
    bitrate_reason: str
    codec: Codec
    encrypted: bool


@dataclass(frozen=True, slots=True)
class Measurement:
    """Statistics of the stream over the last window.

    Args:
        fps: encoded frames per second.
        bitrate_kbps: bit rate of the transport stream.
        viewer_count: connected viewers.
        last_frame_age_ms: since the capture of the newest encoded frame.
        worst_rtt_ms: longest round-trip time of any viewer; None without viewers.
        worst_loss_percent: largest loss of packets to any viewer, as the share of those sent that were sent
            again. None without viewers.
    """

    fps: float
    bitrate_kbps: float
    viewer_count: int
    last_frame_age_ms: int
    worst_rtt_ms: float | None = None
    worst_loss_percent: float | None = None


@dataclass(frozen=True, slots=True)
class RecordedStream:
    """What a recording notes of the stream, whenever it changes.

    Args:
        state: of the pipeline.
        profile: in effect, or about to be.
        error: last error; empty for none.
        stream: None while no pipeline exists.
        encoder: None while no pipeline exists.
        camera: whose frames they are; empty while no pipeline exists.
    """

    state: State
    profile: Profile
    error: str
    stream: StreamState | None
    encoder: EncoderChoice | None
    camera: str = ""


@dataclass(frozen=True, slots=True)
class ActualState:
    """State of the service at one moment.

    Args:
        instance_id: random per process.
        applied_revision: newest desired state applied; 0 for none.
        state: of the preview for viewers; DISABLED where a pipeline runs for a recording alone.
        profile: of the newest desired state; a running pipeline follows at once.
        last_error: last error since the preview was enabled; empty for none.
        counters: counts since the process started.
        address: where viewers reach the listener: as bound, or as its container's port is published.
        port: UDP port of the listener.
        latency_ms: SRT latency of the listener (SRTO_LATENCY).
        capture_offset_ns: capture time minus PTS, of every stream.
        stream: None while no pipeline exists for viewers.
        encoder: None while no pipeline exists for viewers.
        measurement: None before the end of the first window.
        pipeline_state: of the one pipeline that serves all reasons.
        reasons: for which it is to run, in the order of their definition.
        wanted_camera: of the newest desired state.
        cameras: all of them, in the order of the configuration.
    """

    instance_id: str
    applied_revision: int
    state: State
    profile: Profile
    last_error: str
    counters: Counters
    address: str
    port: int
    latency_ms: int
    capture_offset_ns: int
    stream: StreamState | None = None
    encoder: EncoderChoice | None = None
    measurement: Measurement | None = None
    pipeline_state: State = State.DISABLED
    reasons: tuple[Reason, ...] = ()
    wanted_camera: str = ""
    cameras: tuple[Camera, ...] = ()
