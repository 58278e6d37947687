"""Recording as messages of the contract."""

from dataclasses import fields
from typing import Any, Final

from gateway.rpc.mapping.enums import (
    RECORDER_STATES,
    RECORDING_CHANGES,
    RECORDING_KINDS,
    RECORDING_STATES,
    RECORDING_STOP_REASONS,
)
from gateway.status.event import RecordingChanged
from gateway.status.recording import RecorderStatus, RecorderView, RecordingPreset
from omniseer.gateway.v1 import event_pb2
from omniseer.gateway.v1 import recording_pb2 as pb

_CONVERTED: Final = frozenset({"state", "presets"})
_SAME_NAMES: Final = tuple(each.name for each in fields(RecorderStatus) if each.name not in _CONVERTED)
_PRESET_NAMES: Final = tuple(each.name for each in fields(RecordingPreset))


def recording_status(view: RecorderView) -> pb.RecordingStatus:
    """Returns recording as part of the status."""
    status = view.status
    values: dict[str, Any] = {name: getattr(status, name) for name in _SAME_NAMES}
    message = pb.RecordingStatus(state=RECORDER_STATES[status.state], **values)
    for preset in status.presets:
        message.presets.add(**{name: getattr(preset, name) for name in _PRESET_NAMES})
    return message


def recording_changed(detail: RecordingChanged) -> event_pb2.RecordingStateChanged:
    """Returns the payload of an event."""
    return event_pb2.RecordingStateChanged(
        change=RECORDING_CHANGES[detail.change],
        recording_id=detail.recording_id,
        label=detail.label,
        kind=RECORDING_KINDS[detail.kind],
        state=RECORDING_STATES[detail.state],
        stop_reason=RECORDING_STOP_REASONS[detail.stop_reason],
        messages_lost=detail.messages_lost,
        uncounted_gaps=detail.uncounted_gaps,
    )
