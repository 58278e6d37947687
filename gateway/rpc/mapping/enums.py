"""Every enum of the domain and its value in the contract. A test checks that the tables are total."""

from collections.abc import Mapping
from typing import Final

from common.errors import InvalidRequestError
from gateway.status.event import ControlResult
from gateway.status.events import GapReason
from gateway.status.fault import Severity
from gateway.status.health import HealthState
from gateway.status.preview import Codec, PreviewState, Profile
from gateway.status.source_view import SourceState
from omniseer.gateway.v1 import event_pb2, fault_pb2, preview_pb2, source_pb2, states_pb2

PREVIEW_STATES: Final[Mapping[PreviewState, states_pb2.PreviewState.ValueType]] = {
    PreviewState.DISABLED: states_pb2.PREVIEW_DISABLED,
    PreviewState.STARTING: states_pb2.PREVIEW_STARTING,
    PreviewState.RUNNING: states_pb2.PREVIEW_RUNNING,
    PreviewState.STOPPING: states_pb2.PREVIEW_STOPPING,
    PreviewState.FAULTED: states_pb2.PREVIEW_FAULTED,
}
PROFILES: Final[Mapping[Profile | None, preview_pb2.PreviewProfile.ValueType]] = {
    None: preview_pb2.PREVIEW_PROFILE_UNSPECIFIED,
    Profile.LOW_BW: preview_pb2.PREVIEW_PROFILE_LOW_BW,
    Profile.BALANCED: preview_pb2.PREVIEW_PROFILE_BALANCED,
    Profile.HIGH_QUALITY: preview_pb2.PREVIEW_PROFILE_HIGH_QUALITY,
}
CODECS: Final[Mapping[Codec | None, preview_pb2.VideoCodec.ValueType]] = {
    None: preview_pb2.VIDEO_CODEC_UNSPECIFIED,
    Codec.H264: preview_pb2.VIDEO_CODEC_H264,
    Codec.H265: preview_pb2.VIDEO_CODEC_H265,
}
HEALTH_STATES: Final[Mapping[HealthState, states_pb2.RobotHealthState.ValueType]] = {
    HealthState.OK: states_pb2.ROBOT_HEALTH_OK,
    HealthState.DEGRADED: states_pb2.ROBOT_HEALTH_DEGRADED,
}
SEVERITIES: Final[Mapping[Severity, fault_pb2.FaultSeverity.ValueType]] = {
    Severity.INFO: fault_pb2.FAULT_SEVERITY_INFO,
    Severity.WARNING: fault_pb2.FAULT_SEVERITY_WARNING,
    Severity.ERROR: fault_pb2.FAULT_SEVERITY_ERROR,
}
SOURCE_STATES: Final[Mapping[SourceState, source_pb2.SourceState.ValueType]] = {
    SourceState.WAITING: source_pb2.SOURCE_STATE_WAITING,
    SourceState.SILENT: source_pb2.SOURCE_STATE_SILENT,
    SourceState.RECEIVING: source_pb2.SOURCE_STATE_RECEIVING,
    SourceState.STALE: source_pb2.SOURCE_STATE_STALE,
    SourceState.QOS_MISMATCH: source_pb2.SOURCE_STATE_QOS_MISMATCH,
    SourceState.WRONG_TYPE: source_pb2.SOURCE_STATE_WRONG_TYPE,
    SourceState.TYPE_MISSING: source_pb2.SOURCE_STATE_TYPE_MISSING,
}
CONTROL_RESULTS: Final[Mapping[ControlResult, event_pb2.ControlResult.ValueType]] = {
    ControlResult.ACCEPTED: event_pb2.CONTROL_RESULT_ACCEPTED,
    ControlResult.REFUSED: event_pb2.CONTROL_RESULT_REFUSED,
    ControlResult.FAILED: event_pb2.CONTROL_RESULT_FAILED,
}
GAP_REASONS: Final[Mapping[GapReason, event_pb2.EventGapReason.ValueType]] = {
    GapReason.NO_LONGER_KEPT: event_pb2.EVENT_GAP_REASON_NO_LONGER_KEPT,
    GapReason.NEW_RUN: event_pb2.EVENT_GAP_REASON_NEW_RUN,
}
_PROFILE_OF: Final[Mapping[int, Profile | None]] = {number: profile for profile, number in PROFILES.items()}
_SEVERITY_OF: Final[Mapping[int, Severity]] = {number: severity for severity, number in SEVERITIES.items()}


def least_severity_from(number: int) -> Severity:
    """Returns the minimum severity that a client requests; the schema's rules reject unknown numbers."""
    return _SEVERITY_OF.get(number, Severity.INFO)


def profile_from(number: int) -> Profile | None:
    """Returns the profile that a client requests; None to keep the current one.

    Raises:
        InvalidRequestError: the contract has no such profile.
    """
    if number not in _PROFILE_OF:
        known = ", ".join(
            f"{value} {profile.value if profile else 'keep'}" for profile, value in PROFILES.items()
        )
        raise InvalidRequestError(f"profile {number} does not exist; choose one of {known}")
    return _PROFILE_OF[number]
