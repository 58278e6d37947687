"""The contract's enumerations. A number without a counterpart reads UNKNOWN, never an error."""

from enum import Enum
from typing import Any, Final, Generic, Protocol, TypeVar

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
from omniseer.gateway.v1 import event_pb2, fault_pb2, preview_pb2, source_pb2, states_pb2

MemberT = TypeVar("MemberT", bound=Enum)


class _WireEnum(Protocol):
    """A generated enumeration."""

    def Value(self, name: str) -> Any:  # noqa: N802 - protobuf's name
        """Returns the number of a name."""


class EnumMapping(Generic[MemberT]):
    """Converts between numbers of the contract and members of an enumeration.

    The contract names its values PREFIX_MEMBER. Its UNSPECIFIED, always 0, is the member UNKNOWN.

    Args:
        members: The enumeration.
        wire: The contract's.
        prefix: Of the contract's names, without the underscore.
    """

    def __init__(self, members: type[MemberT], wire: _WireEnum, prefix: str) -> None:
        self._unknown = members["UNKNOWN"]
        named = [member for member in members if member is not self._unknown]
        self._numbers = {member: wire.Value(f"{prefix}_{member.name}") for member in named}
        self._members = {number: member for member, number in self._numbers.items()}

    def __call__(self, number: int) -> MemberT:
        """Returns the member of a number."""
        return self._members.get(number, self._unknown)

    def number(self, member: MemberT) -> Any:
        """Returns the number of a member."""
        return self._numbers.get(member, 0)


preview_state: Final = EnumMapping(PreviewState, states_pb2.PreviewState, "PREVIEW")
preview_profile: Final = EnumMapping(PreviewProfile, preview_pb2.PreviewProfile, "PREVIEW_PROFILE")
health_state: Final = EnumMapping(HealthState, states_pb2.RobotHealthState, "ROBOT_HEALTH")
teleop_state: Final = EnumMapping(TeleopState, states_pb2.TeleopState, "TELEOP")
video_codec: Final = EnumMapping(VideoCodec, preview_pb2.VideoCodec, "VIDEO_CODEC")
stream_transport: Final = EnumMapping(StreamTransport, preview_pb2.StreamTransport, "STREAM_TRANSPORT")
stream_container: Final = EnumMapping(StreamContainer, preview_pb2.StreamContainer, "STREAM_CONTAINER")
fault_severity: Final = EnumMapping(FaultSeverity, fault_pb2.FaultSeverity, "FAULT_SEVERITY")
source_state: Final = EnumMapping(SourceState, source_pb2.SourceState, "SOURCE_STATE")
control_result: Final = EnumMapping(ControlResult, event_pb2.ControlResult, "CONTROL_RESULT")
gap_reason: Final = EnumMapping(GapReason, event_pb2.EventGapReason, "EVENT_GAP_REASON")
