"""To and from the private schema that the preview service speaks."""

from collections.abc import Mapping
from typing import Final

from gateway.preview_link.actual import Actual
from gateway.preview_link.wish import Wish
from gateway.status.preview import (
    Codec,
    Counters,
    Encoder,
    Listener,
    Measurement,
    PreviewState,
    Profile,
    Stream,
)
from omniseer.preview.v1 import preview_service_pb2 as pb


class UnknownSpeechError(Exception):
    """The service says what this gateway does not know: the two are not of one version."""


STATES: Final[Mapping[int, PreviewState]] = {
    pb.LIFECYCLE_STATE_DISABLED: PreviewState.DISABLED,
    pb.LIFECYCLE_STATE_STARTING: PreviewState.STARTING,
    pb.LIFECYCLE_STATE_RUNNING: PreviewState.RUNNING,
    pb.LIFECYCLE_STATE_STOPPING: PreviewState.STOPPING,
    pb.LIFECYCLE_STATE_FAULTED: PreviewState.FAULTED,
}
PROFILES: Final[Mapping[Profile, pb.Profile.ValueType]] = {
    Profile.LOW_BW: pb.PROFILE_LOW_BW,
    Profile.BALANCED: pb.PROFILE_BALANCED,
    Profile.HIGH_QUALITY: pb.PROFILE_HIGH_QUALITY,
}
CODECS: Final[Mapping[int, Codec]] = {pb.CODEC_H264: Codec.H264, pb.CODEC_H265: Codec.H265}
_PROFILE_OF: Final[Mapping[int, Profile]] = {number: profile for profile, number in PROFILES.items()}


def to_wire(wish: Wish) -> pb.ApplyDesiredStateRequest:
    """The wish as the service takes it."""
    desired = pb.DesiredState(revision=wish.revision, enabled=wish.enabled, passphrase=wish.passphrase)
    if wish.profile:
        desired.profile = PROFILES[wish.profile]
    return pb.ApplyDesiredStateRequest(desired=desired)


def from_wire(message: pb.ActualState) -> Actual:
    """What the service says.

    Raises:
        UnknownSpeechError: it is in a state that this gateway does not know.
    """
    state = STATES.get(message.state)
    if state is None:
        raise UnknownSpeechError(f"it speaks of a state number {message.state}; its version is another one")
    return Actual(
        instance_id=message.instance_id,
        applied_revision=message.applied_revision,
        state=state,
        profile=_PROFILE_OF.get(message.profile),
        last_error=message.last_error,
        listener=_listener(message.listener) if message.HasField("listener") else None,
        stream=_stream(message.stream) if message.HasField("stream") else None,
        encoder=_encoder(message.encoder) if message.HasField("encoder") else None,
        measurement=_measurement(message.measurement) if message.HasField("measurement") else None,
        counters=_counters(message.counters),
    )


def _listener(message: pb.Listener) -> Listener:
    return Listener(port=message.port, latency_ms=message.latency_ms)


def _stream(message: pb.Stream) -> Stream:
    return Stream(
        width_px=message.width_px,
        height_px=message.height_px,
        fps=message.fps,
        target_bitrate_kbps=message.target_bitrate_kbps,
        codec=CODECS.get(message.codec),
        encrypted=message.encrypted,
        bitrate_reason=message.bitrate_reason,
    )


def _encoder(message: pb.Encoder) -> Encoder:
    return Encoder(
        name=message.name,
        hardware=message.hardware,
        wanted=message.wanted,
        fallback_reason=message.fallback_reason,
    )


def _measurement(message: pb.Measurement) -> Measurement:
    return Measurement(
        fps=message.fps,
        bitrate_kbps=message.bitrate_kbps,
        viewer_count=message.viewer_count,
        last_frame_age_ms=message.last_frame_age_ms,
        worst_rtt_ms=message.worst_rtt_ms if message.HasField("worst_rtt_ms") else None,
        worst_loss_percent=message.worst_loss_percent if message.HasField("worst_loss_percent") else None,
    )


def _counters(message: pb.Counters) -> Counters:
    return Counters(
        starts=message.starts,
        restarts=message.restarts,
        faults=message.faults,
        fallbacks=message.fallbacks,
    )
