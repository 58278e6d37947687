"""How recordings read for people."""

from console.client.exporting import ExportedRecording
from console.client.results import (
    Recording,
    RecordingKind,
    RecordingState,
    RecordingStatus,
    RecordingStopReason,
)
from console.presentation.formatting import age, joined, plural, size
from console.presentation.severity_style import RECORDER_STYLES, SeverityStyle
from console.presentation.value_style import of_recorder

_MS_PER_S = 1000


def recorder_mark(status: RecordingStatus) -> tuple[str, SeverityStyle]:
    """Returns the recorder's state in words, and its style: that of the room where this is short."""
    room_left = of_recorder(status)
    if room_left.style is SeverityStyle.GOOD:
        return status.state.value, RECORDER_STYLES[status.state]
    return joined(status.state.value, room_left.word.lower()), room_left.style


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
        lost(status),
        room(status),
        "" if compact or not status.ring_s else f"the last {status.ring_s} s kept",
        plural(status.snapshots_pending, "snapshot") + " pending" if status.snapshots_pending else "",
        "" if compact else plural(status.recordings, "recording"),
        f"{status.to_copy} to copy" if status.to_copy and not compact else "",
        status.last_error,
    )


def lost(status: RecordingStatus) -> str:
    """Returns what is missing from the recording that runs; empty if nothing is."""
    return joined(
        plural(status.messages_lost, "message") + " lost" if status.messages_lost else "",
        plural(status.uncounted_gaps, "gap") + " of unknown size" if status.uncounted_gaps else "",
    )


def room(status: RecordingStatus) -> str:
    """Returns the room that is left, as time where something is written."""
    if status.room_s is not None:
        return f"room for {age(status.room_s * _MS_PER_S)}"
    return f"room for {size(status.room_bytes)}" if status.room_bytes else ""


def exported(done: ExportedRecording) -> str:
    """Returns what of a recording is on this computer now."""
    return f"{done.folder}: {plural(done.files, 'file')}, {size(done.size)}, verified"


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
    """Returns what is remarkable about a recording: an incident, pinned, incomplete."""
    return joined("" if recording.kind is RecordingKind.MANUAL else recording.kind.value, marks(recording))


def marks(recording: Recording) -> str:
    """Returns what has become of a recording: pinned, incomplete, and why it was made."""
    return joined(
        "pinned" if recording.pinned else "",
        _gaps(recording),
        plural(recording.messages_lost, "message") + " lost" if recording.messages_lost else "",
        recording.trigger,
    )


def _gaps(recording: Recording) -> str:
    if not recording.gap_count:
        return ""
    uncounted = f" ({recording.uncounted_gaps} of unknown size)" if recording.uncounted_gaps else ""
    return plural(recording.gap_count, "gap") + uncounted
