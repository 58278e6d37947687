"""The contract's methods: bytes out of a request's values, a result out of the answer's bytes.

gRPC moves bytes; it is told here how they are made and read, so that everything above speaks results only.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Generic, TypeVar

from console.client.mapping.enums import profile_number, severity_number
from console.client.mapping.events import item
from console.client.mapping.info import gateway_info
from console.client.mapping.overlay import overlay_snapshot
from console.client.mapping.preview import preview
from console.client.mapping.status import system_status
from console.client.results import (
    CaughtUp,
    Event,
    EventGap,
    EventPosition,
    FaultSeverity,
    GatewayInfo,
    OverlaySnapshot,
    PreviewChange,
    PreviewProfile,
    RobotTime,
    SystemStatus,
    WatchedStatus,
)
from omniseer.gateway.v1 import overlay_pb2, robot_gateway_pb2, system_status_pb2

_SERVICE = robot_gateway_pb2.DESCRIPTOR.services_by_name["RobotGateway"]

_MS_PER_S: Final = 1000

RequestT = TypeVar("RequestT")
ResultT = TypeVar("ResultT")


@dataclass(frozen=True, slots=True)
class PreviewRequest:
    """What the operator wants of the preview. A profile that is UNKNOWN keeps the current one."""

    enabled: bool
    profile: PreviewProfile = PreviewProfile.UNKNOWN


@dataclass(frozen=True, slots=True)
class EventsRequest:
    """Which events are asked for.

    Args:
        after: where to go on; None takes what the gateway still keeps.
        least: what matters less is left out; UNKNOWN leaves out nothing.
    """

    after: EventPosition | None = None
    least: FaultSeverity = FaultSeverity.UNKNOWN


@dataclass(frozen=True, slots=True)
class Method(Generic[RequestT, ResultT]):
    """One method of the contract.

    Args:
        name: as in the schema.
        encode: request value to message bytes.
        decode: message bytes to result.
        idempotent: whether asking twice does the same as asking once, so that a lost answer may be asked
            for again.
    """

    name: str
    encode: Callable[[RequestT], bytes]
    decode: Callable[[bytes], ResultT]
    idempotent: bool

    @property
    def path(self) -> str:
        """The method's address on the wire."""
        return f"/{_SERVICE.full_name}/{_SERVICE.methods_by_name[self.name].name}"


def _encode_status_request(_: None) -> bytes:
    return robot_gateway_pb2.GetSystemStatusRequest().SerializeToString()


def _encode_overlay_request(_: None) -> bytes:
    return robot_gateway_pb2.GetOverlaySnapshotRequest().SerializeToString()


def _encode_info_request(_: None) -> bytes:
    return robot_gateway_pb2.GetGatewayInfoRequest().SerializeToString()


def _encode_preview_wish(wish: PreviewRequest) -> bytes:
    request = robot_gateway_pb2.SetPreviewModeRequest(
        enabled=wish.enabled, profile=profile_number(wish.profile)
    )
    return request.SerializeToString()


def _decode_status(data: bytes) -> SystemStatus:
    return system_status(system_status_pb2.SystemStatus.FromString(data))


def _decode_overlay(data: bytes) -> OverlaySnapshot:
    return overlay_snapshot(overlay_pb2.OverlaySnapshot.FromString(data))


def _decode_info(data: bytes) -> GatewayInfo:
    return gateway_info(robot_gateway_pb2.GetGatewayInfoResponse.FromString(data))


def _decode_preview_change(data: bytes) -> PreviewChange:
    answer = robot_gateway_pb2.SetPreviewModeResponse.FromString(data)
    return PreviewChange(accepted=answer.accepted, message=answer.message, preview=preview(answer.preview))


def _encode_watch_request(min_interval_s: float) -> bytes:
    milliseconds = round(min_interval_s * _MS_PER_S)
    return robot_gateway_pb2.WatchSystemStatusRequest(min_interval_ms=milliseconds).SerializeToString()


def _encode_events_request(wanted: EventsRequest) -> bytes:
    request = robot_gateway_pb2.SubscribeEventsRequest(min_severity=severity_number(wanted.least))
    if wanted.after is not None:
        request.after.run_id, request.after.sequence = wanted.after.run_id, wanted.after.sequence
    return request.SerializeToString()


def _encode_ping_request(_: None) -> bytes:
    return robot_gateway_pb2.PingRequest().SerializeToString()


def _decode_watched(data: bytes) -> WatchedStatus:
    message = robot_gateway_pb2.WatchSystemStatusResponse.FromString(data)
    return WatchedStatus(status=system_status(message.status), monotonic_ns=message.monotonic_ns)


def _decode_event_item(data: bytes) -> Event | EventGap | CaughtUp | None:
    return item(robot_gateway_pb2.SubscribeEventsResponse.FromString(data))


def _decode_time(data: bytes) -> RobotTime:
    message = robot_gateway_pb2.PingResponse.FromString(data)
    return RobotTime(
        monotonic_ns=message.monotonic_ns,
        wall_clock_unix_ns=message.wall_clock_unix_ns,
        boot_id=message.boot_id or None,
    )


GET_SYSTEM_STATUS: Final[Method[None, SystemStatus]] = Method(
    "GetSystemStatus", _encode_status_request, _decode_status, idempotent=True
)
# A wish names the state that is wanted, not a change: to wish twice is to wish once.
SET_PREVIEW_MODE: Final[Method[PreviewRequest, PreviewChange]] = Method(
    "SetPreviewMode", _encode_preview_wish, _decode_preview_change, idempotent=True
)
GET_OVERLAY_SNAPSHOT: Final[Method[None, OverlaySnapshot]] = Method(
    "GetOverlaySnapshot", _encode_overlay_request, _decode_overlay, idempotent=True
)
GET_GATEWAY_INFO: Final[Method[None, GatewayInfo]] = Method(
    "GetGatewayInfo", _encode_info_request, _decode_info, idempotent=True
)
PING: Final[Method[None, RobotTime]] = Method("Ping", _encode_ping_request, _decode_time, idempotent=True)
WATCH_SYSTEM_STATUS: Final[Method[float, WatchedStatus]] = Method(
    "WatchSystemStatus", _encode_watch_request, _decode_watched, idempotent=True
)
SUBSCRIBE_EVENTS: Final[Method[EventsRequest, Event | EventGap | CaughtUp | None]] = Method(
    "SubscribeEvents", _encode_events_request, _decode_event_item, idempotent=True
)
METHODS: Final = (GET_SYSTEM_STATUS, SET_PREVIEW_MODE, GET_OVERLAY_SNAPSHOT, GET_GATEWAY_INFO, PING)
"""Every method of the contract with one answer."""
STREAMS: Final = (WATCH_SYSTEM_STATUS, SUBSCRIBE_EVENTS)
"""Every method with a stream of answers (a test compares both lists with the schema)."""
