"""The live preview as the gateway knows it."""

from dataclasses import dataclass, field
from enum import Enum

from gateway.status.values import Received


class PreviewState(Enum):
    """Where the preview is in its life."""

    DISABLED = "disabled"
    STARTING = "starting"
    RUNNING = "running"
    STOPPING = "stopping"
    FAULTED = "faulted"


class Profile(Enum):
    """How much bandwidth the preview may take."""

    LOW_BW = "LOW_BW"
    BALANCED = "BALANCED"
    HIGH_QUALITY = "HIGH_QUALITY"


class Codec(Enum):
    """How the pictures are compressed."""

    H264 = "H.264"
    H265 = "H.265"


@dataclass(frozen=True, slots=True)
class Listener:
    """Where the robot listens for viewers (SRT over UDP)."""

    port: int
    latency_ms: int


@dataclass(frozen=True, slots=True)
class Stream:
    """What a pipeline makes. The codec is None until the encoder is chosen."""

    width_px: int
    height_px: int
    fps: float
    target_bitrate_kbps: int
    codec: Codec | None
    encrypted: bool
    bitrate_reason: str


@dataclass(frozen=True, slots=True)
class Encoder:
    """Which encoder runs, which was wanted, and why it is not that one."""

    name: str
    hardware: bool
    wanted: str
    fallback_reason: str


@dataclass(frozen=True, slots=True)
class Measurement:
    """Figures of the running stream. The worst of all viewers is None without viewers."""

    fps: float
    bitrate_kbps: float
    viewer_count: int
    last_frame_age_ms: int
    worst_rtt_ms: float | None
    worst_loss_percent: float | None


@dataclass(frozen=True, slots=True)
class Counters:
    """How often things happened. They only grow."""

    starts: int = 0
    restarts: int = 0
    faults: int = 0
    fallbacks: int = 0


@dataclass(frozen=True, slots=True)
class PreviewView:
    """Everything a client may learn of the preview. A change of anything makes a new object.

    Attributes:
        profile: the one in force, or the one the next enable will use; None when none was ever chosen.
        last_error: what went wrong and what to do; empty when the preview works.
        listener: None until the preview service has told it.
        stream: None while no pipeline exists; so is `encoder`.
        measured: None before the first measurement of this run.
        passphrase: of this session; empty when the stream is not encrypted.
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
