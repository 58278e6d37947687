"""The contract's enumerations. A number this client has no word for reads UNKNOWN, never an error."""

from collections.abc import Mapping
from typing import Final

from console.client.results import (
    ControlResult,
    FaultSeverity,
    GapReason,
    HealthState,
    PreviewProfile,
    PreviewState,
    SourceState,
    StreamContainer,
    StreamTransport,
    TeleopState,
    VideoCodec,
)
from omniseer.gateway.v1 import event_pb2 as events
from omniseer.gateway.v1 import fault_pb2 as faults
from omniseer.gateway.v1 import preview_pb2 as preview
from omniseer.gateway.v1 import source_pb2 as sources
from omniseer.gateway.v1 import states_pb2 as states

_PREVIEW_STATES: Final[Mapping[int, PreviewState]] = {
    states.PREVIEW_STATE_UNSPECIFIED: PreviewState.UNKNOWN,
    states.PREVIEW_DISABLED: PreviewState.DISABLED,
    states.PREVIEW_RUNNING: PreviewState.RUNNING,
    states.PREVIEW_STARTING: PreviewState.STARTING,
    states.PREVIEW_STOPPING: PreviewState.STOPPING,
    states.PREVIEW_FAULTED: PreviewState.FAULTED,
}
_HEALTH_STATES: Final[Mapping[int, HealthState]] = {
    states.ROBOT_HEALTH_STATE_UNSPECIFIED: HealthState.UNKNOWN,
    states.ROBOT_HEALTH_OK: HealthState.OK,
    states.ROBOT_HEALTH_DEGRADED: HealthState.DEGRADED,
}
_TELEOP_STATES: Final[Mapping[int, TeleopState]] = {
    states.TELEOP_STATE_UNSPECIFIED: TeleopState.UNKNOWN,
    states.TELEOP_DISABLED: TeleopState.DISABLED,
    states.TELEOP_ENABLED: TeleopState.ENABLED,
}
_CODECS: Final[Mapping[int, VideoCodec]] = {
    preview.VIDEO_CODEC_UNSPECIFIED: VideoCodec.UNKNOWN,
    preview.VIDEO_CODEC_H264: VideoCodec.H264,
    preview.VIDEO_CODEC_H265: VideoCodec.H265,
}
_TRANSPORTS: Final[Mapping[int, StreamTransport]] = {
    preview.STREAM_TRANSPORT_UNSPECIFIED: StreamTransport.UNKNOWN,
    preview.STREAM_TRANSPORT_SRT: StreamTransport.SRT,
}
_CONTAINERS: Final[Mapping[int, StreamContainer]] = {
    preview.STREAM_CONTAINER_UNSPECIFIED: StreamContainer.UNKNOWN,
    preview.STREAM_CONTAINER_MPEG_TS: StreamContainer.MPEG_TS,
}
_SEVERITIES: Final[Mapping[int, FaultSeverity]] = {
    faults.FAULT_SEVERITY_UNSPECIFIED: FaultSeverity.UNKNOWN,
    faults.FAULT_SEVERITY_INFO: FaultSeverity.INFO,
    faults.FAULT_SEVERITY_WARNING: FaultSeverity.WARNING,
    faults.FAULT_SEVERITY_ERROR: FaultSeverity.ERROR,
}
_SOURCE_STATES: Final[Mapping[int, SourceState]] = {
    sources.SOURCE_STATE_UNSPECIFIED: SourceState.UNKNOWN,
    sources.SOURCE_STATE_WAITING: SourceState.WAITING,
    sources.SOURCE_STATE_SILENT: SourceState.SILENT,
    sources.SOURCE_STATE_RECEIVING: SourceState.RECEIVING,
    sources.SOURCE_STATE_STALE: SourceState.STALE,
    sources.SOURCE_STATE_QOS_MISMATCH: SourceState.QOS_MISMATCH,
    sources.SOURCE_STATE_WRONG_TYPE: SourceState.WRONG_TYPE,
    sources.SOURCE_STATE_TYPE_MISSING: SourceState.TYPE_MISSING,
}
_CONTROL_RESULTS: Final[Mapping[int, ControlResult]] = {
    events.CONTROL_RESULT_UNSPECIFIED: ControlResult.UNKNOWN,
    events.CONTROL_RESULT_ACCEPTED: ControlResult.ACCEPTED,
    events.CONTROL_RESULT_REFUSED: ControlResult.REFUSED,
    events.CONTROL_RESULT_FAILED: ControlResult.FAILED,
}
_GAP_REASONS: Final[Mapping[int, GapReason]] = {
    events.EVENT_GAP_REASON_UNSPECIFIED: GapReason.UNKNOWN,
    events.EVENT_GAP_REASON_NO_LONGER_KEPT: GapReason.NO_LONGER_KEPT,
    events.EVENT_GAP_REASON_NEW_RUN: GapReason.NEW_RUN,
}
_SEVERITY_NUMBERS: Final = {word: number for number, word in _SEVERITIES.items()}
# Both directions are needed: answers carry a profile, and so do requests.
_PROFILE_NUMBERS: Final[Mapping[PreviewProfile, preview.PreviewProfile.ValueType]] = {
    PreviewProfile.UNKNOWN: preview.PREVIEW_PROFILE_UNSPECIFIED,
    PreviewProfile.LOW_BW: preview.PREVIEW_PROFILE_LOW_BW,
    PreviewProfile.BALANCED: preview.PREVIEW_PROFILE_BALANCED,
    PreviewProfile.HIGH_QUALITY: preview.PREVIEW_PROFILE_HIGH_QUALITY,
}
_PROFILES: Final[Mapping[int, PreviewProfile]] = {word: own for own, word in _PROFILE_NUMBERS.items()}


def preview_state(number: int) -> PreviewState:
    """The preview's state."""
    return _PREVIEW_STATES.get(number, PreviewState.UNKNOWN)


def health_state(number: int) -> HealthState:
    """The robot's health."""
    return _HEALTH_STATES.get(number, HealthState.UNKNOWN)


def teleop_state(number: int) -> TeleopState:
    """Whether the robot takes operator commands."""
    return _TELEOP_STATES.get(number, TeleopState.UNKNOWN)


def video_codec(number: int) -> VideoCodec:
    """How pictures are compressed."""
    return _CODECS.get(number, VideoCodec.UNKNOWN)


def stream_transport(number: int) -> StreamTransport:
    """How the stream is carried."""
    return _TRANSPORTS.get(number, StreamTransport.UNKNOWN)


def stream_container(number: int) -> StreamContainer:
    """What the stream is packed in."""
    return _CONTAINERS.get(number, StreamContainer.UNKNOWN)


def fault_severity(number: int) -> FaultSeverity:
    """How much a fault matters."""
    return _SEVERITIES.get(number, FaultSeverity.UNKNOWN)


def severity_number(severity: FaultSeverity) -> faults.FaultSeverity.ValueType:
    """The severity in a request."""
    return faults.FaultSeverity.ValueType(_SEVERITY_NUMBERS[severity])


def control_result(number: int) -> ControlResult:
    """What became of a control action."""
    return _CONTROL_RESULTS.get(number, ControlResult.UNKNOWN)


def gap_reason(number: int) -> GapReason:
    """Why events are missing."""
    return _GAP_REASONS.get(number, GapReason.UNKNOWN)


def source_state(number: int) -> SourceState:
    """What is known of a source."""
    return _SOURCE_STATES.get(number, SourceState.UNKNOWN)


def preview_profile(number: int) -> PreviewProfile:
    """The profile in an answer."""
    return _PROFILES.get(number, PreviewProfile.UNKNOWN)


def profile_number(profile: PreviewProfile) -> preview.PreviewProfile.ValueType:
    """The profile in a request."""
    return _PROFILE_NUMBERS[profile]
