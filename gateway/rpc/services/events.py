"""What happens on the robot, in order."""

from collections.abc import AsyncIterator

from gateway.rpc.calls.call import CallContext
from gateway.rpc.mapping.enums import least_severity_from
from gateway.rpc.mapping.events import position_from
from gateway.rpc.responses.event_stream import EventStream
from omniseer.gateway.v1.robot_gateway_pb2 import SubscribeEventsRequest


class EventsService:
    """Serves events from the log.

    Args:
        stream: of all subscribers.
    """

    def __init__(self, stream: EventStream) -> None:
        self._stream = stream

    def subscribe_events(self, request: SubscribeEventsRequest, _call: CallContext) -> AsyncIterator[bytes]:
        """Yields SubscribeEventsResponses, serialised, until the caller leaves."""
        after = position_from(request.after) if request.HasField("after") else None
        return self._stream.responses(after, least_severity_from(request.min_severity))
