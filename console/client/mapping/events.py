"""Events, whose payload is one of several messages."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from common.printable import printable
from console.client.mapping.reader import read
from console.client.results import CaughtUp, Event, EventGap, EventKind, EventPosition, Fault
from omniseer.gateway.v1 import event_pb2 as wire
from omniseer.gateway.v1 import robot_gateway_pb2


def event_item(message: robot_gateway_pb2.SubscribeEventsResponse) -> Event | EventGap | CaughtUp | None:
    """Returns the next item; None for a kind that only a newer client knows."""
    match message.WhichOneof("item"):
        case "event":
            return event(message.event)
        case "gap":
            return read(EventGap, message.gap)
        case "caught_up":
            return CaughtUp(position=read(EventPosition, message.caught_up))
        case _:
            return None


def event(message: wire.Event) -> Event:
    """Returns one event."""
    kind, parts = _KINDS.get(message.WhichOneof("payload") or "", _NO_KIND)
    return read(Event, message, kind=kind, **parts(message))


def _client(message: wire.ClientJoined | wire.ClientLeft) -> dict[str, Any]:
    return {"client_address": printable(message.address), "client_name": printable(message.who)}


_Parts = Callable[[wire.Event], dict[str, Any]]
_NO_KIND: Final[tuple[EventKind, _Parts]] = (EventKind.UNKNOWN, lambda _: {})
_KINDS: Final[Mapping[str, tuple[EventKind, _Parts]]] = {
    "fault_raised": (EventKind.FAULT_RAISED, lambda it: {"fault": read(Fault, it.fault_raised.fault)}),
    "fault_cleared": (EventKind.FAULT_CLEARED, lambda it: {"fault": read(Fault, it.fault_cleared.fault)}),
    "preview_state_changed": (EventKind.PREVIEW, lambda _: {}),
    "encoder_fallback": (EventKind.ENCODER_FALLBACK, lambda _: {}),
    "client_joined": (EventKind.CLIENT_JOINED, lambda it: _client(it.client_joined)),
    "client_left": (EventKind.CLIENT_LEFT, lambda it: _client(it.client_left)),
    "control_action": (EventKind.CONTROL, lambda _: {}),
    "recording_state_changed": (EventKind.RECORDING, lambda _: {}),
    "cloud_state_changed": (EventKind.CLOUD, lambda _: {}),
    "recording_copy_changed": (EventKind.RECORDING_COPY, lambda _: {}),
    "robot_mode_changed": (EventKind.MODE, lambda it: {"mode": printable(it.robot_mode_changed.mode)}),
}
"""Payload -> its kind, and the fields of the event that the reader does not find by their names.

Total: a test compares with the payloads of the schema.
"""
