"""Domain values to messages and back: the only place of the service that knows both."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from common.errors import InvalidRequestError
from omniseer.preview.v1 import preview_service_pb2 as pb
from preview.encoders.catalogue import Encoder
from preview.encoders.selection import Verdict
from preview.lifecycle import State
from preview.status import Status, StreamStatus
from preview.values import Codec, EncoderChoice, Measurement, Profile, Wish

STATES: Final[Mapping[State, pb.LifecycleState.ValueType]] = MappingProxyType(
    {
        State.DISABLED: pb.LIFECYCLE_STATE_DISABLED,
        State.STARTING: pb.LIFECYCLE_STATE_STARTING,
        State.RUNNING: pb.LIFECYCLE_STATE_RUNNING,
        State.STOPPING: pb.LIFECYCLE_STATE_STOPPING,
        State.FAULTED: pb.LIFECYCLE_STATE_FAULTED,
    }
)
PROFILES: Final[Mapping[Profile, pb.Profile.ValueType]] = MappingProxyType(
    {
        Profile.LOW_BW: pb.PROFILE_LOW_BW,
        Profile.BALANCED: pb.PROFILE_BALANCED,
        Profile.HIGH_QUALITY: pb.PROFILE_HIGH_QUALITY,
    }
)
CODECS: Final[Mapping[Codec, pb.Codec.ValueType]] = MappingProxyType(
    {Codec.H264: pb.CODEC_H264, Codec.H265: pb.CODEC_H265}
)
_PROFILES_BACK: Final = {message: profile for profile, message in PROFILES.items()}

_SHORTEST_PASSPHRASE: Final = 10
_LONGEST_PASSPHRASE: Final = 79


def wish(desired: pb.DesiredState) -> Wish:
    """What the gateway wants.

    Raises:
        InvalidRequestError: enabled with a profile we don't know, or a passphrase that SRT does not take.
    """
    profile = _PROFILES_BACK.get(desired.profile)
    if profile is None and desired.enabled:
        raise InvalidRequestError(
            f"profile {desired.profile} is not known; known are {', '.join(p.name for p in Profile)}"
        )
    size = len(desired.passphrase.encode())
    if size and not _SHORTEST_PASSPHRASE <= size <= _LONGEST_PASSPHRASE:
        raise InvalidRequestError(
            f"a passphrase of {size} bytes is no SRT passphrase; "
            f"it takes {_SHORTEST_PASSPHRASE} to {_LONGEST_PASSPHRASE}"
        )
    return Wish(desired.revision, desired.enabled, profile or Profile.BALANCED, desired.passphrase)


def actual(status: Status) -> pb.ActualState:
    """What is."""
    counters = status.counters
    return pb.ActualState(
        instance_id=status.instance_id,
        applied_revision=status.applied_revision,
        state=STATES[status.state],
        profile=PROFILES[status.profile],
        last_error=status.last_error,
        stream=_stream(status.stream) if status.stream else None,
        encoder=_encoder(status.encoder) if status.encoder else None,
        measurement=_measurement(status.measurement) if status.measurement else None,
        counters=pb.Counters(
            starts=counters.starts,
            restarts=counters.restarts,
            faults=counters.faults,
            fallbacks=counters.fallbacks,
        ),
        listener=pb.Listener(port=status.port, latency_ms=status.latency_ms),
    )


def candidate(encoder: Encoder, verdict: Verdict) -> pb.EncoderCandidate:
    """One encoder and what came of trying it."""
    return pb.EncoderCandidate(
        name=encoder.name,
        family=encoder.family,
        element=encoder.element,
        codec=CODECS[encoder.codec],
        hardware=encoder.hardware,
        present=verdict.present,
        proven=verdict.proven,
        reason=verdict.reason,
        first_byte_ms=verdict.first_byte_ms,
    )


def _stream(stream: StreamStatus) -> pb.Stream:
    return pb.Stream(
        width_px=stream.target.width_px,
        height_px=stream.target.height_px,
        fps=stream.target.fps,
        target_bitrate_kbps=stream.bitrate_kbps,
        codec=CODECS[stream.codec],
        encrypted=stream.encrypted,
        bitrate_reason=stream.bitrate_reason,
    )


def _encoder(choice: EncoderChoice) -> pb.Encoder:
    return pb.Encoder(
        name=choice.name,
        hardware=choice.hardware,
        wanted=choice.wanted,
        fallback_reason=choice.fallback_reason,
    )


def _measurement(measured: Measurement) -> pb.Measurement:
    return pb.Measurement(
        fps=measured.fps,
        bitrate_kbps=measured.bitrate_kbps,
        viewer_count=measured.viewer_count,
        last_frame_age_ms=measured.last_frame_age_ms,
        worst_rtt_ms=measured.worst_rtt_ms,
        worst_loss_percent=measured.worst_loss_percent,
    )
