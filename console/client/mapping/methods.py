"""The contract's methods: request values to message bytes, message bytes to results.

gRPC moves bytes; these tables are its serializers, so that the code above sees results only.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Generic, TypeVar

from google.protobuf.message import Message

from console.client.mapping import enums
from console.client.mapping.events import event_item
from console.client.mapping.info import gateway_info
from console.client.mapping.overlay import detections, overlay_snapshot
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
from omniseer.gateway.v1 import overlay_pb2, system_status_pb2
from omniseer.gateway.v1 import robot_gateway_pb2 as wire

_SERVICE: Final = wire.DESCRIPTOR.services_by_name["RobotGateway"]
_MS_PER_S: Final = 1000

RequestT = TypeVar("RequestT")
ResultT = TypeVar("ResultT")


@dataclass(frozen=True, slots=True)
class PreviewRequest:
    """The desired state of the preview. A profile that is UNKNOWN keeps the current one."""

    enabled: bool
    profile: PreviewProfile = PreviewProfile.UNKNOWN


@dataclass(frozen=True, slots=True)
class WatchRequest:
    """A subscription to the status.

    Args:
        min_interval_s: Least time between two statuses.
        include_detections: Whether each carries the detections; new ones then count as a change.
    """

    min_interval_s: float
    include_detections: bool = False


@dataclass(frozen=True, slots=True)
class EventsRequest:
    """A subscription to events.

    Args:
        after: Where to resume; None begins with the oldest event that the gateway keeps.
        least: Events of lower severity are left out; UNKNOWN leaves out none.
    """

    after: EventPosition | None = None
    least: FaultSeverity = FaultSeverity.UNKNOWN


@dataclass(frozen=True, slots=True)
class Method(Generic[RequestT, ResultT]):
    """One method of the contract.

    Args:
        name: As in the schema.
        request: Makes the request message.
        answer: Class of the answer message.
        result: Reads the answer message.
        idempotent: Whether two calls have the effect of one, so that a call may be retried.
    """

    name: str
    request: Callable[[RequestT], Message]
    answer: type[Message]
    result: Callable[[Any], ResultT]
    idempotent: bool = True

    @property
    def path(self) -> str:
        """The method's path in HTTP/2, as gRPC forms it: /package.Service/Method."""
        return f"/{_SERVICE.full_name}/{_SERVICE.methods_by_name[self.name].name}"

    def encode(self, request: RequestT) -> bytes:
        """Returns the bytes of the request."""
        return self.request(request).SerializeToString()

    def decode(self, data: bytes) -> ResultT:
        """Returns the result of the answer's bytes."""
        return self.result(self.answer.FromString(data))


def _preview_request(request: PreviewRequest) -> Message:
    profile = enums.preview_profile.number(request.profile)
    return wire.SetPreviewModeRequest(enabled=request.enabled, profile=profile)


def _preview_change(answer: wire.SetPreviewModeResponse) -> PreviewChange:
    return PreviewChange(accepted=answer.accepted, message=answer.message, preview=preview(answer.preview))


def _watch_request(request: WatchRequest) -> Message:
    return wire.WatchSystemStatusRequest(
        min_interval_ms=round(request.min_interval_s * _MS_PER_S),
        include_detections=request.include_detections,
    )


def _watched_status(answer: wire.WatchSystemStatusResponse) -> WatchedStatus:
    return WatchedStatus(
        status=system_status(answer.status),
        monotonic_ns=answer.monotonic_ns,
        detections=detections(answer.detections) if answer.HasField("detections") else None,
    )


def _events_request(request: EventsRequest) -> Message:
    message = wire.SubscribeEventsRequest(min_severity=enums.fault_severity.number(request.least))
    if request.after is not None:
        message.after.run_id, message.after.sequence = request.after.run_id, request.after.sequence
    return message


def _robot_time(answer: wire.PingResponse) -> RobotTime:
    return RobotTime(
        monotonic_ns=answer.monotonic_ns,
        wall_clock_unix_ns=answer.wall_clock_unix_ns,
        boot_id=answer.boot_id or None,
    )


GET_SYSTEM_STATUS: Final[Method[None, SystemStatus]] = Method(
    "GetSystemStatus", lambda _: wire.GetSystemStatusRequest(), system_status_pb2.SystemStatus, system_status
)
# Idempotent, because a request names the desired state, not a change.
SET_PREVIEW_MODE: Final[Method[PreviewRequest, PreviewChange]] = Method(
    "SetPreviewMode", _preview_request, wire.SetPreviewModeResponse, _preview_change
)
GET_OVERLAY_SNAPSHOT: Final[Method[None, OverlaySnapshot]] = Method(
    "GetOverlaySnapshot",
    lambda _: wire.GetOverlaySnapshotRequest(),
    overlay_pb2.OverlaySnapshot,
    overlay_snapshot,
)
GET_GATEWAY_INFO: Final[Method[None, GatewayInfo]] = Method(
    "GetGatewayInfo", lambda _: wire.GetGatewayInfoRequest(), wire.GetGatewayInfoResponse, gateway_info
)
PING: Final[Method[None, RobotTime]] = Method(
    "Ping", lambda _: wire.PingRequest(), wire.PingResponse, _robot_time
)
WATCH_SYSTEM_STATUS: Final[Method[WatchRequest, WatchedStatus]] = Method(
    "WatchSystemStatus", _watch_request, wire.WatchSystemStatusResponse, _watched_status
)
SUBSCRIBE_EVENTS: Final[Method[EventsRequest, Event | EventGap | CaughtUp | None]] = Method(
    "SubscribeEvents", _events_request, wire.SubscribeEventsResponse, event_item
)
METHODS: Final = (GET_SYSTEM_STATUS, SET_PREVIEW_MODE, GET_OVERLAY_SNAPSHOT, GET_GATEWAY_INFO, PING)
"""The unary methods."""
STREAMS: Final = (WATCH_SYSTEM_STATUS, SUBSCRIBE_EVENTS)
"""The server-streaming methods. A test compares both lists with the schema."""
