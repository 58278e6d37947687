"""What is: one immutable picture of the service, for whoever watches."""

from dataclasses import dataclass

from preview.lifecycle import Counters, State
from preview.values import Codec, EncoderChoice, Measurement, Profile, Target


@dataclass(frozen=True, slots=True)
class StreamStatus:
    """What is served.

    Args:
        target: size, rate and the profile's own bit rate.
        bitrate_kbps: what the encoder is told to keep now.
        bitrate_reason: why that is not the profile's own; empty when it is.
        codec: how the pictures are compressed.
        encrypted: whether a viewer needs a passphrase.
    """

    target: Target
    bitrate_kbps: int
    bitrate_reason: str
    codec: Codec
    encrypted: bool


@dataclass(frozen=True, slots=True)
class Status:
    """The service at one moment.

    Args:
        instance_id: random for every process.
        applied_revision: the newest wish; 0 for none.
        state: where the preview is in its life.
        profile: of the pipeline, or of the newest wish.
        last_error: what went wrong since it was last enabled; empty for nothing.
        counters: since the process started.
        port: the listener's UDP port.
        latency_ms: the listener's SRT latency.
        stream: None while no pipeline exists.
        encoder: None while no pipeline exists.
        measurement: None before the first window.
    """

    instance_id: str
    applied_revision: int
    state: State
    profile: Profile
    last_error: str
    counters: Counters
    port: int
    latency_ms: int
    stream: StreamStatus | None = None
    encoder: EncoderChoice | None = None
    measurement: Measurement | None = None
