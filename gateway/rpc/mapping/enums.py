"""Every enum of the domain and its value in the contract. A test checks that the tables are total."""

from collections.abc import Mapping
from enum import Enum
from typing import Any, Final, TypeVar

from common.errors import InvalidRequestError
from gateway.status.cloud import CloudState, RecordingCopyState
from gateway.status.event import ControlResult
from gateway.status.event_log import GapReason
from gateway.status.fault import Severity
from gateway.status.health import HealthState
from gateway.status.meaning import Side
from gateway.status.pictures import Delivery
from gateway.status.preview import CameraState, Codec, PreviewState, Profile
from gateway.status.recording import (
    RecorderState,
    RecordingChange,
    RecordingKind,
    RecordingState,
    RecordingStopReason,
)
from gateway.status.source_view import SourceState
from gateway.status.teleop import DriveInhibit, DrivePhase
from gateway.status.values import Fix
from omniseer.gateway.v1 import (
    cloud_pb2,
    event_pb2,
    fault_pb2,
    pose_pb2,
    preview_pb2,
    recording_pb2,
    source_pb2,
    states_pb2,
    teleop_pb2,
    value_pb2,
)

_MemberT = TypeVar("_MemberT", bound=Enum)


def _by_name(domain: type[_MemberT], wire: Any, prefix: str) -> dict[_MemberT, Any]:
    """Returns the value of the same name for each member. Raises ValueError, at import, if there is none."""
    return {member: wire.Value(f"{prefix}_{member.name}") for member in domain}


def _or_none(domain: type[_MemberT], wire: Any, prefix: str) -> Mapping[_MemberT | None, Any]:
    """As `_by_name`, and UNSPECIFIED for None."""
    return {None: wire.Value(f"{prefix}_UNSPECIFIED")} | _by_name(domain, wire, prefix)


PREVIEW_STATES: Final = _by_name(PreviewState, states_pb2.PreviewState, "PREVIEW")
PROFILES: Final = _or_none(Profile, preview_pb2.PreviewProfile, "PREVIEW_PROFILE")
CAMERA_STATES: Final = _or_none(CameraState, preview_pb2.CameraState, "CAMERA_STATE")
CODECS: Final = _or_none(Codec, preview_pb2.VideoCodec, "VIDEO_CODEC")
DELIVERIES: Final = _or_none(Delivery, preview_pb2.PictureDelivery, "PICTURE_DELIVERY")
HEALTH_STATES: Final = _by_name(HealthState, states_pb2.RobotHealthState, "ROBOT_HEALTH")
SEVERITIES: Final = _by_name(Severity, fault_pb2.FaultSeverity, "FAULT_SEVERITY")
SOURCE_STATES: Final = _by_name(SourceState, source_pb2.SourceState, "SOURCE_STATE")
FIXES: Final = _by_name(Fix, pose_pb2.FixStatus, "FIX_STATUS")
NUMBER_LEVELS: Final = {
    (severity, side): value_pb2.NumberLevel.Value(f"NUMBER_LEVEL_{severity.name}_{side.name}")
    for severity in (Severity.WARNING, Severity.ERROR)
    for side in Side
}
"""Of numbers beyond a limit."""
TEXT_LEVELS: Final = {
    severity: value_pb2.TextLevel.Value(f"TEXT_LEVEL_{severity.name}")
    for severity in (Severity.WARNING, Severity.ERROR)
}
"""Of texts that are bad."""
CONTROL_RESULTS: Final = _by_name(ControlResult, event_pb2.ControlResult, "CONTROL_RESULT")
TELEOP_STATES: Final = {False: states_pb2.TELEOP_DISABLED, True: states_pb2.TELEOP_ENABLED}
DRIVE_PHASES: Final = _by_name(DrivePhase, teleop_pb2.DrivePhase, "DRIVE_PHASE")
DRIVE_INHIBITS: Final = _by_name(DriveInhibit, teleop_pb2.DriveInhibit, "DRIVE_INHIBIT")
RECORDER_STATES: Final = _by_name(RecorderState, recording_pb2.RecorderState, "RECORDER_STATE")
RECORDING_CHANGES: Final = _by_name(RecordingChange, event_pb2.RecordingChange, "RECORDING_CHANGE")
RECORDING_KINDS: Final = _or_none(RecordingKind, recording_pb2.RecordingKind, "RECORDING_KIND")
RECORDING_STATES: Final = _or_none(RecordingState, recording_pb2.RecordingState, "RECORDING_STATE")
RECORDING_STOP_REASONS: Final = _or_none(
    RecordingStopReason, recording_pb2.RecordingStopReason, "RECORDING_STOP_REASON"
)
CLOUD_STATES: Final = _by_name(CloudState, cloud_pb2.CloudState, "CLOUD_STATE")
COPY_STATES: Final = _by_name(RecordingCopyState, recording_pb2.RecordingCopyState, "RECORDING_COPY_STATE")
GAP_REASONS: Final = _by_name(GapReason, event_pb2.EventGapReason, "EVENT_GAP_REASON")
_PROFILE_OF: Final[Mapping[int, Profile | None]] = {number: profile for profile, number in PROFILES.items()}
_DELIVERY_OF: Final[Mapping[int, Delivery | None]] = {
    number: delivery for delivery, number in DELIVERIES.items()
}
_SEVERITY_OF: Final[Mapping[int, Severity]] = {number: severity for severity, number in SEVERITIES.items()}


def least_severity_from(number: int) -> Severity:
    """Returns the minimum severity that a client requests; the schema's rules reject unknown numbers."""
    return _SEVERITY_OF.get(number, Severity.INFO)


def delivery_from(number: int) -> Delivery | None:
    """Returns how a viewer takes the stream; the schema's rules reject unknown numbers."""
    return _DELIVERY_OF.get(number)


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
