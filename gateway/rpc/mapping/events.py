"""Events as messages of the contract."""

from collections.abc import Callable
from dataclasses import asdict
from typing import Any, Final

from gateway.rpc.mapping.cloud import cloud_changed, recording_copy_changed
from gateway.rpc.mapping.enums import CONTROL_RESULTS, GAP_REASONS, PREVIEW_STATES, PROFILES, SEVERITIES
from gateway.rpc.mapping.faults import fill_fault
from gateway.rpc.mapping.recording import recording_changed
from gateway.status.event import (
    ClientJoined,
    ClientLeft,
    CloudChanged,
    ControlAction,
    EncoderFallback,
    FaultCleared,
    FaultRaised,
    LoggedEvent,
    ModeChanged,
    PreviewChanged,
    RecordingChanged,
    RecordingCopyChanged,
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


def _raised(detail: FaultRaised, at_s: float) -> pb.FaultRaised:
    message = pb.FaultRaised()
    fill_fault(message.fault, detail.fault, at_s)
    return message


def _cleared(detail: FaultCleared, at_s: float) -> pb.FaultCleared:
    message = pb.FaultCleared()
    fill_fault(message.fault, detail.fault, at_s)
    return message


def _preview(detail: PreviewChanged, _at_s: float) -> pb.PreviewStateChanged:
    return pb.PreviewStateChanged(
        state=PREVIEW_STATES[detail.state],
        profile=PROFILES[detail.profile],
        last_error=detail.last_error,
        camera=detail.camera,
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
    FaultRaised: ("fault_raised", _raised),
    FaultCleared: ("fault_cleared", _cleared),
    PreviewChanged: ("preview_state_changed", _preview),
    EncoderFallback: ("encoder_fallback", lambda it, _: pb.EncoderFallback(**asdict(it))),
    ClientJoined: ("client_joined", lambda it, _: pb.ClientJoined(**asdict(it))),
    ClientLeft: ("client_left", lambda it, _: pb.ClientLeft(**asdict(it))),
    ControlAction: ("control_action", _control),
    ModeChanged: ("robot_mode_changed", lambda it, _: pb.RobotModeChanged(**asdict(it))),
    RecordingChanged: ("recording_state_changed", lambda it, _: recording_changed(it)),
    CloudChanged: ("cloud_state_changed", lambda it, _: cloud_changed(it)),
    RecordingCopyChanged: ("recording_copy_changed", lambda it, _: recording_copy_changed(it)),
}
"""Total: a test checks every kind of event, and every payload of the schema."""
