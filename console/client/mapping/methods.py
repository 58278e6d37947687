"""The contract's methods: request values to message bytes, message bytes to results."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, Generic, TypeVar

from google.protobuf.message_factory import GetMessageClass

from console.client import results
from console.client.mapping import enums
from console.client.mapping.events import event_item
from console.client.mapping.reader import read
from console.client.results import EventPosition, FaultSeverity, PreviewProfile
from omniseer.gateway.v1 import robot_gateway_pb2 as wire

_SERVICE: Final = wire.DESCRIPTOR.services_by_name["RobotGateway"]
_MS_PER_S: Final = 1000

RequestT = TypeVar("RequestT")
ResultT = TypeVar("ResultT")


@dataclass(frozen=True, slots=True)
class DesiredPreview:
    """Desired state of the preview. UNKNOWN keeps the current profile."""

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
        result: Reads the answer message.
        fields: Returns the fields of the request message; a request of None has none.
        idempotent: Whether two calls have the effect of one, so that a call may be retried.
    """

    name: str
    result: Callable[[Any], ResultT]
    fields: Callable[[RequestT], dict[str, Any]] = lambda _: {}
    idempotent: bool = True

    @property
    def path(self) -> str:
        """The method's path in HTTP/2, as gRPC forms it: /package.Service/Method."""
        return f"/{_SERVICE.full_name}/{self.name}"

    def encode(self, request: RequestT) -> bytes:
        """Returns the bytes of the request."""
        message = GetMessageClass(_SERVICE.methods_by_name[self.name].input_type)
        return message(**self.fields(request)).SerializeToString()

    def decode(self, data: bytes) -> ResultT:
        """Returns the result of the answer's bytes.

        Raises:
            DecodeError: They are not an answer of this method.
        """
        return self.result(GetMessageClass(_SERVICE.methods_by_name[self.name].output_type).FromString(data))


def _preview_fields(request: DesiredPreview) -> dict[str, Any]:
    return {"enabled": request.enabled, "profile": enums.number(request.profile)}


def _watch_fields(request: WatchRequest) -> dict[str, Any]:
    interval_ms = round(request.min_interval_s * _MS_PER_S)
    return {"min_interval_ms": interval_ms, "include_detections": request.include_detections}


def _events_fields(request: EventsRequest) -> dict[str, Any]:
    after = request.after
    position = {"run_id": after.run_id, "sequence": after.sequence} if after else None
    return {"after": position, "min_severity": enums.number(request.least)}


GET_SYSTEM_STATUS: Final[Method[None, results.SystemStatus]] = Method(
    "GetSystemStatus", partial(read, results.SystemStatus)
)
# Idempotent, because a request names the desired state, not a change.
SET_PREVIEW_MODE: Final[Method[DesiredPreview, results.PreviewChange]] = Method(
    "SetPreviewMode", partial(read, results.PreviewChange), _preview_fields
)
GET_OVERLAY_SNAPSHOT: Final[Method[None, results.OverlaySnapshot]] = Method(
    "GetOverlaySnapshot", partial(read, results.OverlaySnapshot)
)
GET_GATEWAY_INFO: Final[Method[None, results.GatewayInfo]] = Method(
    "GetGatewayInfo", partial(read, results.GatewayInfo)
)
PING: Final[Method[None, results.RobotTime]] = Method("Ping", partial(read, results.RobotTime))
WATCH_SYSTEM_STATUS: Final[Method[WatchRequest, results.WatchedStatus]] = Method(
    "WatchSystemStatus", partial(read, results.WatchedStatus), _watch_fields
)
SUBSCRIBE_EVENTS: Final[Method[EventsRequest, results.Event | results.EventGap | results.CaughtUp | None]] = (
    Method("SubscribeEvents", event_item, _events_fields)
)
METHODS: Final = (GET_SYSTEM_STATUS, SET_PREVIEW_MODE, GET_OVERLAY_SNAPSHOT, GET_GATEWAY_INFO, PING)
"""The unary methods."""
STREAMS: Final = (WATCH_SYSTEM_STATUS, SUBSCRIBE_EVENTS)
"""The server-streaming methods. A test compares both lists with the schema."""
