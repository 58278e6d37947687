"""Views of the recorder, for tests of what follows from them."""

from typing import Any

from gateway.status.recording import (
    RecorderReport,
    RecorderState,
    RecorderStatus,
    RecorderView,
    RecordingBrief,
    RecordingKind,
    RecordingPreset,
    RecordingState,
    RecordingStopReason,
)
from gateway.status.values import Received


def status(**more: Any) -> RecorderStatus:
    """A recorder that records, with everything that its status can have."""
    values: dict[str, Any] = {
        "state": RecorderState.RECORDING,
        "recording_id": "20260101T000000Z-abc001",
        "label": "lap 1",
        "preset": "driving",
        "elapsed_ms": 61_003,
        "size": 7_000_001,
        "messages_written": 9_001,
        "messages_lost": 17,
        "uncounted_gaps": 13,
        "video": True,
        "bytes_per_s": 1_000_003,
        "room_bytes": 5_000_000_007,
        "room_s": 5_009,
        "ring_s": 31,
        "snapshots_pending": 3,
        "recordings": 37,
        "to_copy": 5,
        "last_error": "a topic has a type that is not installed",
        "presets": (RecordingPreset("driving", "what driving needs", True, 60_000_011, True),),
    }
    return RecorderStatus(**(values | more))


def idle(**more: Any) -> RecorderStatus:
    """A recorder that waits."""
    return RecorderStatus(RecorderState.IDLE, **more)


def view(reported: RecorderStatus, at_s: float, **more: Any) -> RecorderView:
    """A recorder that answers; `more` is of its report."""
    return RecorderView("", Received(RecorderReport("a process", reported, **more), at_s))


def recording_view(at_s: float) -> RecorderView:
    """A recorder that records."""
    return view(status(), at_s, messages_lost=17, disk_free_bytes=5, disk_size_bytes=9)


def ended(recording_id: str, **more: Any) -> RecordingBrief:
    """A recording that has ended."""
    values: dict[str, Any] = {
        "label": "",
        "kind": RecordingKind.MANUAL,
        "state": RecordingState.COMPLETE,
        "stop_reason": RecordingStopReason.REQUESTED,
        "messages_lost": None,
    }
    return RecordingBrief(recording_id, **(values | more))
