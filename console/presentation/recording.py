"""How recordings read for people."""

from console.client.results import (
    Recording,
    RecordingKind,
    RecordingState,
    RecordingStatus,
    RecordingStopReason,
)
from console.presentation.formatting import age, joined, plural, size

_MS_PER_S = 1000


def recording_summary(status: RecordingStatus, *, compact: bool) -> str:
    """Returns the recorder on one line: what runs, how long it may go on, what is lost."""
    runs = joined(
        status.label or status.preset,
        age(status.elapsed_ms),
        size(status.size),
        "" if status.video or compact else "without video",
    )
    return joined(
        runs if status.recording_id else "",
        plural(status.messages_lost, "message") + " lost" if status.messages_lost else "",
        room(status),
        "" if compact or not status.ring_s else f"the last {status.ring_s} s kept",
        plural(status.snapshots_pending, "snapshot") + " pending" if status.snapshots_pending else "",
        "" if compact else plural(status.recordings, "recording"),
        f"{status.to_copy} to copy" if status.to_copy and not compact else "",
        status.last_error,
    )


def room(status: RecordingStatus) -> str:
    """Returns the room that is left, as time where something is written."""
    if status.room_s is not None:
        return f"room for {age(status.room_s * _MS_PER_S)}"
    return f"room for {size(status.room_bytes)}" if status.room_bytes else ""


def recording_state(recording: Recording) -> str:
    """Returns the state of a recording, with why it ended where that is not as requested."""
    expected = recording.stop_reason in (RecordingStopReason.UNKNOWN, RecordingStopReason.REQUESTED)
    return recording.state.value if expected else f"{recording.state.value} ({recording.stop_reason.value})"


def is_written(recording: Recording) -> bool:
    """Whether the recording is not complete yet."""
    return recording.state in {
        RecordingState.STARTING,
        RecordingState.RECORDING,
        RecordingState.FINALISING,
    }


def remarks(recording: Recording) -> str:
    """Returns what is remarkable about a recording: pinned, incomplete, an incident."""
    return joined(
        "" if recording.kind is RecordingKind.MANUAL else recording.kind.value,
        "pinned" if recording.pinned else "",
        plural(recording.gap_count, "gap") if recording.gap_count else "",
        plural(recording.messages_lost, "message") + " lost" if recording.messages_lost else "",
        recording.trigger,
    )
