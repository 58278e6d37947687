"""Events, from the contract's messages."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from console.client.mapping import enums
from console.client.mapping.status import fault
from console.client.results import (
    CaughtUp,
    ControlAction,
    EncoderFallback,
    Event,
    EventGap,
    EventKind,
    EventPosition,
    PreviewEvent,
)
from omniseer.gateway.v1 import event_pb2 as wire
from omniseer.gateway.v1 import robot_gateway_pb2


def event_item(message: robot_gateway_pb2.SubscribeEventsResponse) -> Event | EventGap | CaughtUp | None:
    """Returns the next item; None for a kind that only a newer client knows."""
    match message.WhichOneof("item"):
        case "event":
            return event(message.event)
        case "gap":
            return gap(message.gap)
        case "caught_up":
            return CaughtUp(position=position(message.caught_up))
        case _:
            return None


def event(message: wire.Event) -> Event:
    """Returns one event."""
    kind, parts = _KINDS.get(message.WhichOneof("payload") or "", _NO_KIND)
    return Event(
        position=EventPosition(message.run_id, message.sequence),
        monotonic_ns=message.monotonic_ns,
        wall_clock_unix_ms=message.wall_clock_unix_ms,
        severity=enums.fault_severity(message.severity),
        component=message.component,
        message=message.message,
        kind=kind,
        **parts(message),
    )


def gap(message: wire.EventGap) -> EventGap:
    """Returns one gap."""
    return EventGap(
        reason=enums.gap_reason(message.reason),
        missed_count=message.missed_count,
        position=position(message.position),
    )


def position(message: wire.EventPosition) -> EventPosition:
    """Returns one position."""
    return EventPosition(message.run_id, message.sequence)


def _preview(message: wire.PreviewStateChanged) -> PreviewEvent:
    return PreviewEvent(
        state=enums.preview_state(message.state),
        profile=enums.preview_profile(message.profile),
        last_error=message.last_error,
    )


def _fallback(message: wire.EncoderFallback) -> EncoderFallback:
    return EncoderFallback(running=message.running, wanted=message.wanted, reason=message.reason)


def _control(message: wire.ControlAction) -> ControlAction:
    return ControlAction(
        who=message.who,
        address=message.address,
        method=message.method,
        request=message.request,
        result=enums.control_result(message.result),
        answer=message.answer,
    )


_Parts = Callable[[wire.Event], dict[str, Any]]
_NO_KIND: Final[tuple[EventKind, _Parts]] = (EventKind.UNKNOWN, lambda _: {})
_KINDS: Final[Mapping[str, tuple[EventKind, _Parts]]] = {
    "fault_raised": (EventKind.FAULT_RAISED, lambda it: {"fault": fault(it.fault_raised.fault)}),
    "fault_cleared": (EventKind.FAULT_CLEARED, lambda it: {"fault": fault(it.fault_cleared.fault)}),
    "preview_state_changed": (EventKind.PREVIEW, lambda it: {"preview": _preview(it.preview_state_changed)}),
    "encoder_fallback": (
        EventKind.ENCODER_FALLBACK,
        lambda it: {"encoder_fallback": _fallback(it.encoder_fallback)},
    ),
    "client_joined": (EventKind.CLIENT_JOINED, lambda it: {"client_address": it.client_joined.address}),
    "client_left": (EventKind.CLIENT_LEFT, lambda it: {"client_address": it.client_left.address}),
    "control_action": (EventKind.CONTROL, lambda it: {"control": _control(it.control_action)}),
    "robot_mode_changed": (EventKind.MODE, lambda it: {"mode": it.robot_mode_changed.mode}),
}
"""Total: a test compares with the payloads of the schema."""
