"""Maps domain values to messages and back: the only module of the service that knows both."""

from collections.abc import Mapping
from dataclasses import asdict
from types import MappingProxyType
from typing import Final

from common.errors import InvalidRequestError
from omniseer.preview.v1 import preview_service_pb2 as pb
from preview.encoders.catalogue import Encoder
from preview.encoders.probe import Verdict
from preview.state.cameras import Camera, CameraState
from preview.state.lifecycle import Reason, State
from preview.state.values import ActualState, Codec, DesiredState, Profile, StreamState

STATES: Final[Mapping[State, pb.LifecycleState.ValueType]] = MappingProxyType(
    {state: pb.LifecycleState.Value(f"LIFECYCLE_STATE_{state.name}") for state in State}
)
PROFILES: Final[Mapping[Profile, pb.Profile.ValueType]] = MappingProxyType(
    {profile: pb.Profile.Value(f"PROFILE_{profile.name}") for profile in Profile}
)
CODECS: Final[Mapping[Codec, pb.Codec.ValueType]] = MappingProxyType(
    {codec: pb.Codec.Value(f"CODEC_{codec.name}") for codec in Codec}
)
REASONS: Final[Mapping[Reason, pb.Reason.ValueType]] = MappingProxyType(
    {reason: pb.Reason.Value(f"REASON_{reason.name}") for reason in Reason}
)
CAMERA_STATES: Final[Mapping[CameraState, pb.CameraState.ValueType]] = MappingProxyType(
    {state: pb.CameraState.Value(f"CAMERA_STATE_{state.name}") for state in CameraState}
)
_PROFILES_BACK: Final = {message: profile for profile, message in PROFILES.items()}

# SRTO_PASSPHRASE takes 10 to 79 bytes (libsrt's API documentation).
_MIN_PASSPHRASE_BYTES: Final = 10
_MAX_PASSPHRASE_BYTES: Final = 79


def desired_state(message: pb.DesiredState) -> DesiredState:
    """Returns the desired state of a message.

    Raises:
        InvalidRequestError: enabled with an unknown profile, or a passphrase of a length that SRT rejects.
    """
    profile = _PROFILES_BACK.get(message.profile)
    if profile is None and message.enabled:
        raise InvalidRequestError(
            f"profile {message.profile} is not known; known are {', '.join(p.value for p in Profile)}"
        )
    size = len(message.passphrase.encode())
    if size and not _MIN_PASSPHRASE_BYTES <= size <= _MAX_PASSPHRASE_BYTES:
        raise InvalidRequestError(
            f"the passphrase has {size} bytes; SRT takes {_MIN_PASSPHRASE_BYTES} to {_MAX_PASSPHRASE_BYTES}"
        )
    return DesiredState(
        message.revision,
        message.enabled,
        profile or Profile.BALANCED,
        message.passphrase,
        message.camera,
    )


def actual_state(actual: ActualState) -> pb.ActualState:
    """Returns the message of an actual state; where names agree, fields are copied by name."""
    return pb.ActualState(
        instance_id=actual.instance_id,
        applied_revision=actual.applied_revision,
        state=STATES[actual.state],
        profile=PROFILES[actual.profile],
        last_error=actual.last_error,
        stream=_stream(actual.stream) if actual.stream else None,
        encoder=pb.Encoder(**asdict(actual.encoder)) if actual.encoder else None,
        measurement=pb.Measurement(**asdict(actual.measurement)) if actual.measurement else None,
        counters=pb.Counters(**asdict(actual.counters)),
        listener=pb.Listener(
            address=actual.address,
            port=actual.port,
            latency_ms=actual.latency_ms,
            capture_offset_ns=actual.capture_offset_ns,
        ),
        pipeline_state=STATES[actual.pipeline_state],
        reasons=[REASONS[reason] for reason in actual.reasons],
        wanted_camera=actual.wanted_camera,
        cameras=[_camera(camera) for camera in actual.cameras],
    )


def _camera(camera: Camera) -> pb.Camera:
    return pb.Camera(
        name=camera.name, state=CAMERA_STATES[camera.state], error=camera.error, fallback=camera.fallback
    )


def candidate(encoder: Encoder, verdict: Verdict) -> pb.EncoderCandidate:
    """Returns the message of an encoder and its trial."""
    return pb.EncoderCandidate(
        name=encoder.name,
        family=encoder.family,
        element=encoder.element,
        codec=CODECS[encoder.codec],
        hardware=encoder.hardware,
        **asdict(verdict),
    )


def _stream(stream: StreamState) -> pb.Stream:
    return pb.Stream(
        width_px=stream.target.width_px,
        height_px=stream.target.height_px,
        fps=stream.target.fps,
        target_bitrate_kbps=stream.bitrate_kbps,
        codec=CODECS[stream.codec],
        encrypted=stream.encrypted,
        bitrate_reason=stream.bitrate_reason,
    )
