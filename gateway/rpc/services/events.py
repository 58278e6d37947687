"""What happens on the robot, in order."""

from collections.abc import AsyncIterator
from dataclasses import dataclass

from gateway.rpc.calls.call import CallContext
from gateway.rpc.mapping.enums import least_severity_from
from gateway.rpc.mapping.events import position_from
from gateway.rpc.responses.event_stream import EventStream
from omniseer.gateway.v1.robot_gateway_pb2 import SubscribeEventsRequest


@dataclass(frozen=True, slots=True)
class EventsService:
    """Serves events from the log: one stream to all subscribers."""

    stream: EventStream

    def subscribe_events(self, request: SubscribeEventsRequest, _call: CallContext) -> AsyncIterator[bytes]:
        """Yields SubscribeEventsResponses, serialised, until the caller leaves."""
        after = position_from(request.after) if request.HasField("after") else None
        return self.stream.responses(after, least_severity_from(request.min_severity))
