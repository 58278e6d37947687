"""The contract's enumerations. A number without a counterpart reads UNKNOWN, never an error."""

from collections.abc import Mapping
from enum import Enum
from functools import cache
from typing import Any, Final, TypeVar, cast

from console.client import results
from omniseer.gateway.v1 import event_pb2, fault_pb2, preview_pb2, source_pb2, states_pb2

MemberT = TypeVar("MemberT", bound=Enum)

# The contract names its values PREFIX_MEMBER. Its UNSPECIFIED, always 0, is the member UNKNOWN.
_WIRE: Final[Mapping[type[Enum], tuple[Any, str]]] = {
    results.PreviewState: (states_pb2.PreviewState, "PREVIEW"),
    results.PreviewProfile: (preview_pb2.PreviewProfile, "PREVIEW_PROFILE"),
    results.HealthState: (states_pb2.RobotHealthState, "ROBOT_HEALTH"),
    results.TeleopState: (states_pb2.TeleopState, "TELEOP"),
    results.VideoCodec: (preview_pb2.VideoCodec, "VIDEO_CODEC"),
    results.StreamTransport: (preview_pb2.StreamTransport, "STREAM_TRANSPORT"),
    results.StreamContainer: (preview_pb2.StreamContainer, "STREAM_CONTAINER"),
    results.FaultSeverity: (fault_pb2.FaultSeverity, "FAULT_SEVERITY"),
    results.SourceState: (source_pb2.SourceState, "SOURCE_STATE"),
    results.ControlResult: (event_pb2.ControlResult, "CONTROL_RESULT"),
    results.GapReason: (event_pb2.EventGapReason, "EVENT_GAP_REASON"),
}


def member(members: type[MemberT], number: int) -> MemberT:
    """Returns the member of a number."""
    return cast("MemberT", _by_number(members).get(number, members["UNKNOWN"]))


def number(member: Enum) -> Any:
    """Returns the number of a member."""
    return next((number for number, each in _by_number(type(member)).items() if each is member), 0)


@cache
def _by_number(members: type[Enum]) -> Mapping[int, Enum]:
    wire, prefix = _WIRE[members]
    named = [each for each in members if each.name != "UNKNOWN"]
    return {wire.Value(f"{prefix}_{each.name}"): each for each in named}
