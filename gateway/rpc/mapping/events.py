"""Events as messages of the contract."""

from collections.abc import Callable
from dataclasses import asdict
from typing import Any, Final

from gateway.rpc.mapping.enums import CONTROL_RESULTS, GAP_REASONS, PREVIEW_STATES, PROFILES, SEVERITIES
from gateway.rpc.mapping.faults import fault_message
from gateway.status.event import (
    ClientJoined,
    ClientLeft,
    ControlAction,
    EncoderFallback,
    FaultCleared,
    FaultRaised,
    LoggedEvent,
    ModeChanged,
    PreviewChanged,
)
from gateway.status.event_log import Gap, Position
from omniseer.gateway.v1 import event_pb2 as pb

_NS_PER_S: Final = 1_000_000_000


def event_message(logged: LoggedEvent, run_id: str) -> pb.Event:
    """Returns one event of this run."""
    event = logged.event
    field, payload = _PAYLOADS[type(event.detail)]
    message = pb.Event(
        run_id=run_id,
        sequence=logged.sequence,
        monotonic_ns=int(logged.at_s * _NS_PER_S),
        wall_clock_unix_ms=logged.unix_ms,
        severity=SEVERITIES[event.severity],
        component=event.component,
        message=event.message,
    )
    getattr(message, field).CopyFrom(payload(event.detail, logged.at_s))
    return message


def gap_message(gap: Gap) -> pb.EventGap:
    """Returns the notice that events are missing."""
    return pb.EventGap(
        reason=GAP_REASONS[gap.reason], missed_count=gap.missed, position=position_message(gap.position)
    )


def position_message(position: Position) -> pb.EventPosition:
    """Returns the position in the event log."""
    return pb.EventPosition(run_id=position.run_id, sequence=position.sequence)


def position_from(message: pb.EventPosition) -> Position:
    """Returns the position after which a client resumes."""
    return Position(message.run_id, message.sequence)


def _preview(detail: PreviewChanged, _at_s: float) -> pb.PreviewStateChanged:
    return pb.PreviewStateChanged(
        state=PREVIEW_STATES[detail.state], profile=PROFILES[detail.profile], last_error=detail.last_error
    )


def _control(detail: ControlAction, _at_s: float) -> pb.ControlAction:
    return pb.ControlAction(
        who=detail.who,
        address=detail.address,
        method=detail.method,
        request=detail.request,
        result=CONTROL_RESULTS[detail.result],
        answer=detail.answer,
    )


_PAYLOADS: Final[dict[type, tuple[str, Callable[[Any, float], Any]]]] = {
    FaultRaised: ("fault_raised", lambda it, at_s: pb.FaultRaised(fault=fault_message(it.fault, at_s))),
    FaultCleared: ("fault_cleared", lambda it, at_s: pb.FaultCleared(fault=fault_message(it.fault, at_s))),
    PreviewChanged: ("preview_state_changed", _preview),
    EncoderFallback: ("encoder_fallback", lambda it, _: pb.EncoderFallback(**asdict(it))),
    ClientJoined: ("client_joined", lambda it, _: pb.ClientJoined(**asdict(it))),
    ClientLeft: ("client_left", lambda it, _: pb.ClientLeft(**asdict(it))),
    ControlAction: ("control_action", _control),
    ModeChanged: ("robot_mode_changed", lambda it, _: pb.RobotModeChanged(**asdict(it))),
}
"""Total: a test checks every kind of event, and every payload of the schema."""
