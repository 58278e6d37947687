"""Which recordings are to be copied, and whether a copy is that of its recording still. Pure."""

from typing import Final

from bridge.uploads.queue import Priority, State, Upload
from console.client import results

_STATES: Final = {
    State.LOCAL: results.RecordingCopyState.UNKNOWN,
    State.QUEUED: results.RecordingCopyState.QUEUED,
    State.UPLOADING: results.RecordingCopyState.UPLOADING,
    State.VERIFYING: results.RecordingCopyState.VERIFYING,
    State.VERIFIED: results.RecordingCopyState.VERIFIED,
    State.PAUSED: results.RecordingCopyState.PAUSED,
    State.FAILED: results.RecordingCopyState.FAILED,
}
"""As the recorder keeps them."""


def new_upload(recording: results.Recording, lowest: Priority = Priority.OTHER) -> Upload:
    """Returns the upload of a recording that is not in the queue yet."""
    priority = lowest
    if recording.kind is results.RecordingKind.INCIDENT:
        priority = Priority.INCIDENT
    elif recording.pinned:
        priority = Priority.PINNED
    return Upload(
        recording_id=recording.id,
        label=recording.label,
        priority=priority,
        started_unix_ms=recording.started_unix_ms,
        size=recording.size,
        bundle=recording.kind is results.RecordingKind.RUN_BUNDLE,
    )


def is_wanted(recording: results.Recording, *, selected: bool) -> bool:
    """Returns whether a recording that the queue does not have is to be copied."""
    match recording.copy.state:
        case results.RecordingCopyState.VERIFIED:
            return False
        case results.RecordingCopyState.UNKNOWN:
            return selected
        case _:
            return True


def is_known(upload: Upload, copy: results.RecordingCopy) -> bool:
    """Returns whether the recorder has an upload as it is, but for its bytes, which change all the time."""
    return (copy.state, copy.reason) == (_STATES[upload.state], upload.reason)


def differs(upload: Upload, recording: results.Recording) -> bool:
    """Returns whether a recording is not the one that was verified: a folder of experiments may grow.

    Of one that the robot's disk refuses to read nothing is known: it has failed, and has no files.
    """
    if recording.state is results.RecordingState.FAULTED and not recording.file_count:
        return False
    return recording.size != upload.size or bool(
        recording.sha256 and upload.sha256 and recording.sha256 != upload.sha256
    )


def selects(rule: str, recording: results.Recording) -> bool:
    """Returns whether a rule of the configuration (`uploads.rule`) has a recording copied."""
    incident = recording.kind is results.RecordingKind.INCIDENT
    return {
        "none": False,
        "incidents": incident,
        "pinned": incident or recording.pinned,
        "all": True,
    }[rule]
