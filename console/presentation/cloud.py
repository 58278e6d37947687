"""How the robot's connection to its fleet, and copies of its recordings, read for people."""

from console.client.results import CloudState, CloudStatus, RecordingCopy, RecordingCopyState
from console.presentation.formatting import age, joined, plural, quantity, size


def cloud_summary(status: CloudStatus, *, compact: bool) -> str:
    """Returns the connection on one line: to which fleet, what waits, what is copied."""
    named = joined(status.robot, f"fleet {status.fleet}" if status.fleet else "")
    waits = plural(status.outbox_events, "event") + " to send" if status.outbox_events else ""
    return joined(
        "" if compact else named,
        waits,
        plural(status.events_dropped, "event") + " dropped" if status.events_dropped else "",
        "" if compact or status.last_sent_age_ms is None else f"last sent {age(status.last_sent_age_ms)} ago",
        _uploads(status, compact=compact),
        status.last_error,
    )


def copy_text(copy: RecordingCopy, whole: int = 0) -> str:
    """Returns the copy of a recording on one line; empty where no copy is wanted.

    Args:
        copy: of the recording.
        whole: size of the recording; 0 leaves out how far it is.
    """
    if copy.state is RecordingCopyState.UNKNOWN:
        return ""
    part = 100 * copy.bytes_done / whole if whole else 0.0
    far = quantity(min(part, 100.0), "%", 0) if copy.state is RecordingCopyState.UPLOADING and whole else ""
    return f"{copy.state.value} {far}".strip()


def _uploads(status: CloudStatus, *, compact: bool) -> str:
    if status.state is CloudState.UNREACHABLE or not status.uploads_waiting:
        return ""
    beyond = f" and {status.uploads_left_out} more without a place" if status.uploads_left_out else ""
    waiting = plural(status.uploads_waiting, "recording") + f" to copy{beyond}"
    if status.uploading is None:
        return joined(waiting, status.uploads_paused)
    far = copy_text(status.uploading, status.uploading_size)
    rate = f"{size(status.upload_bytes_per_s)}/s" if status.upload_bytes_per_s else ""
    return joined(waiting, far if compact else joined(f"{status.uploading_id} {far}", rate))
