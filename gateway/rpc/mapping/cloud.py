"""The fleet as messages of the contract."""

from dataclasses import fields
from typing import Any, Final

from gateway.rpc.mapping.enums import CLOUD_STATES, COPY_STATES
from gateway.status.cloud import CloudStatus, CloudView, RecordingCopy
from gateway.status.event import CloudChanged, RecordingCopyChanged
from omniseer.gateway.v1 import cloud_pb2 as pb
from omniseer.gateway.v1 import event_pb2, recording_pb2

_CONVERTED: Final = frozenset({"state", "uploading"})
_SAME_NAMES: Final = tuple(each.name for each in fields(CloudStatus) if each.name not in _CONVERTED)


def cloud_status(view: CloudView, now_s: float) -> pb.CloudStatus:
    """Returns the connection to the fleet as part of the status."""
    status = view.status(now_s)
    values: dict[str, Any] = {name: getattr(status, name) for name in _SAME_NAMES}
    uploading = recording_copy(status.uploading) if status.uploading else None
    return pb.CloudStatus(state=CLOUD_STATES[status.state], uploading=uploading, **values)


def recording_copy(copy: RecordingCopy) -> recording_pb2.RecordingCopy:
    """Returns the copy of a recording."""
    return recording_pb2.RecordingCopy(
        state=COPY_STATES[copy.state], reason=copy.reason, bytes_done=copy.bytes_done
    )


def cloud_changed(detail: CloudChanged) -> event_pb2.CloudStateChanged:
    """Returns the payload of an event."""
    return event_pb2.CloudStateChanged(state=CLOUD_STATES[detail.state], last_error=detail.last_error)


def recording_copy_changed(detail: RecordingCopyChanged) -> event_pb2.RecordingCopyChanged:
    """Returns the payload of an event."""
    return event_pb2.RecordingCopyChanged(
        recording_id=detail.recording_id, label=detail.label, copy=recording_copy(detail.copy)
    )
