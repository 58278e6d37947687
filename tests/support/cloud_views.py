"""Views of the bridge, for tests of what follows from them."""

from typing import Any

from gateway.status.cloud import (
    BridgeReport,
    CloudState,
    CloudStatus,
    CloudView,
    CopyReport,
    RecordingCopy,
    RecordingCopyState,
)

NEVER = CloudView("not connected yet", 0.0)


def connected(**more: Any) -> CloudStatus:
    """A bridge that reaches its hub."""
    values: dict[str, Any] = {"state": CloudState.CONNECTED, "robot": "lab-1", "fleet": "lab"}
    return CloudStatus(**(values | more))


def report(status: CloudStatus | None = None, **more: Any) -> BridgeReport:
    """A report of the bridge's process "a"."""
    values: dict[str, Any] = {"instance_id": "a", "status": status or connected()}
    return BridgeReport(**(values | more))


def view(status: CloudStatus, at_s: float, **more: Any) -> CloudView:
    """A bridge that answers; `more` is of its report."""
    return NEVER.reported(report(status, **more), at_s)


def copy_of(recording_id: str, state: RecordingCopyState, **more: Any) -> CopyReport:
    """The copy of a recording."""
    return CopyReport(recording_id, RecordingCopy(state, **more))


def uploading_view(at_s: float) -> CloudView:
    """A bridge with everything that its status can have."""
    status = CloudStatus(
        state=CloudState.OFFLINE,
        robot="lab-1",
        fleet="lab",
        state_age_ms=61_003,
        outbox_events=11,
        outbox_bytes=7_001,
        outbox_max_bytes=67_108_864,
        events_dropped=3,
        events_sent=9_001,
        last_sent_age_ms=2_001,
        uploads_waiting=2,
        uploading_id="20260101T000000Z-abc001",
        uploading=RecordingCopy(RecordingCopyState.UPLOADING, "a reason", 5_000_003),
        uploading_size=10_000_001,
        upload_bytes_per_s=1_000_003,
        uploads_paused="not charging",
        last_error="no route to the hub",
        uploads_left_out=4,
    )
    return view(status, at_s)
