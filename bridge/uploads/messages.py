"""A recording as the hub gets it, from what the gateway's client returns."""

from enum import Enum
from typing import Any

from console.client import results
from fleet.receipt_keys import digest_of
from omniseer.gateway.v1 import recording_pb2 as wire


def file_message(file: results.RecordingFile) -> wire.RecordingFile:
    """Returns a file's message."""
    return wire.RecordingFile(name=file.name, size=file.size, sha256=file.sha256, final=file.final)


def recording_message(recording: results.Recording) -> wire.Recording:
    """Returns the message of a recording, without files and gaps, and with the sum of its files."""
    return wire.Recording(
        id=recording.id,
        label=recording.label,
        notes=recording.notes,
        kind=_number(wire.RecordingKind, recording.kind),
        state=_number(wire.RecordingState, recording.state),
        stop_reason=_number(wire.RecordingStopReason, recording.stop_reason),
        preset=recording.preset,
        started_unix_ms=recording.started_unix_ms,
        ended_unix_ms=recording.ended_unix_ms,
        started_monotonic_ns=recording.started_monotonic_ns,
        ended_monotonic_ns=recording.ended_monotonic_ns,
        boot_id=recording.boot_id,
        recorder_run_id=recording.recorder_run_id,
        duration_ms=recording.duration_ms,
        size=sum(file.size for file in recording.files),
        messages_written=recording.messages_written,
        messages_lost=recording.messages_lost,
        uncounted_gaps=recording.uncounted_gaps,
        video_frames=recording.video_frames,
        trigger=recording.trigger,
        pinned=recording.pinned,
        file_count=len(recording.files),
        gap_count=recording.gap_count,
        sha256=digest_of(map(file_message, recording.files)),
    )


def _number(numbers: Any, member: Enum) -> Any:
    """Returns the number of a member: the schema calls it by the enumeration's name and the member's."""
    number: Any
    for name, number in numbers.items():
        if name.endswith(f"_{member.name}"):
            return number
    return 0
