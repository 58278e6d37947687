"""Maps domain values to messages and back: the only module of the recorder that knows both."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

from common.errors import InvalidRequestError
from common.open_file import Chunk
from omniseer.gateway.v1 import recording_pb2 as pb
from omniseer.recorder.v1 import recorder_service_pb2 as recorder_pb
from recorder.config import RecorderSettings
from recorder.lifecycle import State
from recorder.requests import Live
from recorder.status_reader import StatusReader
from recorder.store.manifest import Copy, CopyState, Kind, Manifest, RecordingState, StopReason
from recorder.store.run_bundles import Bundle
from recorder.values import Gap, GapCause

STATES: Final[Mapping[State, pb.RecorderState.ValueType]] = MappingProxyType(
    {each: pb.RecorderState.Value(f"RECORDER_STATE_{each.name}") for each in State}
)
KINDS: Final[Mapping[Kind, pb.RecordingKind.ValueType]] = MappingProxyType(
    {each: pb.RecordingKind.Value(f"RECORDING_KIND_{each.name}") for each in Kind}
)
RECORDING_STATES: Final[Mapping[RecordingState, pb.RecordingState.ValueType]] = MappingProxyType(
    {each: pb.RecordingState.Value(f"RECORDING_STATE_{each.name}") for each in RecordingState}
)
STOP_REASONS: Final[Mapping[StopReason, pb.RecordingStopReason.ValueType]] = MappingProxyType(
    {each: pb.RecordingStopReason.Value(f"RECORDING_STOP_REASON_{each.name}") for each in StopReason}
)
GAP_CAUSES: Final[Mapping[GapCause, pb.RecordingGapCause.ValueType]] = MappingProxyType(
    {each: pb.RecordingGapCause.Value(f"RECORDING_GAP_CAUSE_{each.name}") for each in GapCause}
)
COPY_STATES: Final[Mapping[CopyState, pb.RecordingCopyState.ValueType]] = MappingProxyType(
    {
        each: pb.RecordingCopyState.Value(
            "RECORDING_COPY_STATE_UNSPECIFIED"
            if each is CopyState.NONE
            else f"RECORDING_COPY_STATE_{each.name}"
        )
        for each in CopyState
    }
)
_COPY_STATES_BACK: Final = {message: state for state, message in COPY_STATES.items()}
_NS_PER_MS: Final = 1_000_000


def recording(status_reader: StatusReader, manifest: Manifest, *, whole: bool = False) -> pb.Recording:
    """Returns the message of a recording.

    Args:
        status_reader: have how far it has come, if it runs.
        manifest: of the recording.
        whole: whether with its files and gaps.
    """
    live = status_reader.live(manifest)
    gaps = manifest.all_gaps
    message = pb.Recording(
        id=manifest.id,
        label=manifest.label,
        notes=manifest.notes,
        kind=KINDS[manifest.kind],
        state=RECORDING_STATES[manifest.state],
        stop_reason=(
            STOP_REASONS[manifest.stop_reason]
            if manifest.stop_reason
            else pb.RECORDING_STOP_REASON_UNSPECIFIED
        ),
        preset=manifest.preset,
        started_unix_ms=manifest.started_unix_ms,
        ended_unix_ms=manifest.ended_unix_ms,
        started_monotonic_ns=manifest.started_monotonic_ns,
        ended_monotonic_ns=manifest.ended_monotonic_ns,
        boot_id=manifest.boot_id,
        recorder_run_id=manifest.run_id,
        duration_ms=live.duration_ms,
        size=manifest.size + live.part_bytes,
        messages_written=live.messages,
        video_frames=live.frames,
        trigger=manifest.trigger,
        pinned=manifest.pinned,
        copy=_copy(manifest.copied),
        file_count=len(manifest.files) + bool(live.part),
        gap_count=len(gaps),
        sha256=manifest.sha256,
    )
    message.uncounted_gaps = live.losses.uncounted
    if (lost := live.losses.counted) is not None:
        message.messages_lost = lost
    if whole:
        message.files.extend(_files(manifest, live)[:10_000])
        message.gaps.extend(_gap(each) for each in gaps)
    return message


def bundle(found: Bundle, sums: Mapping[str, bytes] | None = None) -> pb.Recording:
    """Returns the message of a run bundle; with its files if their sums are given."""
    final = found.final
    message = pb.Recording(
        id=found.id,
        label=found.folder.name if found.folder.name.isprintable() else "",
        kind=pb.RECORDING_KIND_RUN_BUNDLE,
        state=RECORDING_STATES[found.state],
        started_unix_ms=found.started_unix_ms,
        ended_unix_ms=found.ended_ns // _NS_PER_MS if final else 0,
        duration_ms=(found.ended_ns - found.began_ns) // _NS_PER_MS,
        size=found.size,
        file_count=len(found.files),
    )
    if found.state is RecordingState.RECOVERED:
        message.stop_reason = pb.RECORDING_STOP_REASON_INTERRUPTED
    for file in found.files if sums is not None else ():
        sha256 = (sums or {}).get(file.name, b"")
        message.files.add(name=file.name, size=file.size, sha256=sha256, final=final and bool(sha256))
    return message


def status(status_reader: StatusReader, settings: RecorderSettings) -> pb.RecordingStatus:
    """Returns the message of the recorder's state."""
    message = pb.RecordingStatus(
        state=STATES[status_reader.phase.state],
        bytes_per_s=status_reader.bytes_per_s,
        room_bytes=max(status_reader.room.bytes, 0),
        ring_s=status_reader.ring_s,
        snapshots_pending=status_reader.snapshots_pending,
        last_error=status_reader.last_error,
        presets=[
            pb.RecordingPreset(
                name=name,
                description=preset.description,
                with_video=preset.video and settings.video.socket is not None,
                bytes_per_minute=status_reader.bytes_per_minute.get(name, 0),
                in_ring=name == settings.ring.preset,
            )
            for name, preset in settings.presets.items()
        ],
    )
    recordings = status_reader.recordings
    message.recordings = len(recordings)
    message.to_copy = sum(each.copied.outstanding for each in recordings)
    if (room_s := status_reader.room_s) is not None:
        message.room_s = int(min(room_s, 1e9))
    if running := status_reader.running:
        live = status_reader.live(running)
        message.recording_id = running.id
        message.label = running.label
        message.preset = running.preset
        message.elapsed_ms = live.duration_ms
        message.size = running.size + live.part_bytes
        message.messages_written = live.messages
        message.video = live.frames > 0
        message.uncounted_gaps = live.losses.uncounted
        if (lost := live.losses.counted) is not None:
            message.messages_lost = lost
    return message


def watch_state(status_reader: StatusReader, settings: RecorderSettings) -> recorder_pb.WatchStateResponse:
    """Returns the message that the gateway watches."""
    newest = status_reader.newest
    message = recorder_pb.WatchStateResponse(
        instance_id=status_reader.run_id,
        status=status(status_reader, settings),
        newest=recording(status_reader, newest) if newest else None,
        messages_dropped=status_reader.dropped,
        disk_free_bytes=status_reader.room.disk.free_bytes,
        disk_size_bytes=status_reader.room.disk.size_bytes,
        disk_short=status_reader.disk_short,
        ended=[recording(status_reader, each) for each in status_reader.recently_ended],
        uncounted_gaps=status_reader.losses.uncounted,
        ring_failures=status_reader.ring_failures,
    )
    if (lost := status_reader.losses.counted) is not None:
        message.messages_lost = lost
    return message


def copy(message: pb.RecordingCopy) -> Copy:
    """Returns the state of a copy.

    Raises:
        InvalidRequestError: a state that is not known here.
    """
    state = _COPY_STATES_BACK.get(message.state)
    if state is None:
        raise InvalidRequestError(f"copy state {message.state} is not known")
    return Copy(state=state, reason=message.reason, bytes_done=message.bytes_done)


def _copy(value: Copy) -> pb.RecordingCopy:
    return pb.RecordingCopy(state=COPY_STATES[value.state], reason=value.reason, bytes_done=value.bytes_done)


def _files(manifest: Manifest, live: Live) -> list[pb.RecordingFile]:
    files = [
        pb.RecordingFile(name=file.name, size=file.size, sha256=bytes.fromhex(file.sha256), final=True)
        for file in manifest.files
    ]
    if live.part:
        files.append(pb.RecordingFile(name=live.part, size=live.part_bytes))
    return files


def _gap(gap: Gap) -> pb.RecordingGap:
    update: dict[str, Any] = {} if gap.messages is None else {"messages": gap.messages}
    return pb.RecordingGap(
        cause=GAP_CAUSES[gap.cause],
        began_unix_ms=max(gap.began_ns, 0) // _NS_PER_MS,
        ended_unix_ms=max(gap.ended_ns, 0) // _NS_PER_MS,
        **update,
    )


def export_chunk(chunk: Chunk) -> pb.ExportRecordingResponse:
    """Returns the message of a chunk."""
    message = pb.ExportChunk(offset=chunk.offset, data=chunk.data, crc32c=chunk.crc32c)
    return pb.ExportRecordingResponse(chunk=message)
