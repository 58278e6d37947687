"""Every enum of the domain and its value in the contract. The tables are total; a test walks them."""

from collections.abc import Mapping
from typing import Final

from common.errors import InvalidRequestError
from gateway.status.faults.fault import Severity
from gateway.status.health import HealthState
from gateway.status.preview import Codec, PreviewState, Profile
from gateway.status.sources import SourceState
from omniseer.gateway.v1 import fault_pb2, preview_pb2, source_pb2, states_pb2

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
_PROFILE_OF: Final[Mapping[int, Profile | None]] = {number: profile for profile, number in PROFILES.items()}


def profile_from(number: int) -> Profile | None:
    """The profile a client asks for; None for "keep the current one".

    Raises:
        InvalidRequestError: the contract has no such profile.
    """
    if number not in _PROFILE_OF:
        known = ", ".join(
            f"{value} {profile.value if profile else 'keep'}" for profile, value in PROFILES.items()
        )
        raise InvalidRequestError(f"profile {number} does not exist; choose one of {known}")
    return _PROFILE_OF[number]
