"""Maps domain values to messages and back: the only module of the recorder that knows both."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

from common.errors import InvalidRequestError
from common.open_file import Chunk
from omniseer.gateway.v1 import recording_pb2 as pb
from omniseer.recorder.v1 import recorder_service_pb2 as recorder_pb
from recorder.config import RecorderSettings
from recorder.recording.lifecycle import State
from recorder.recording.status_reader import StatusReader
from recorder.rpc.file_pages import FilePage, file_page
from recorder.store.manifest import Copy, CopyState, Kind, Manifest, RecordingState, StopReason
from recorder.store.run_bundles import Bundle, BundleSummary
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
MOST_MADE: Final = 1000
"""Messages of recordings that are kept."""
_NS_PER_MS: Final = 1_000_000


def recording(status_reader: StatusReader, manifest: Manifest) -> pb.Recording:
    """Returns the message of a recording, without its files and gaps.

    Args:
        status_reader: has how far it has come, if it runs.
        manifest: of the recording.
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
    return message


def recording_page(status_reader: StatusReader, manifest: Manifest, token: str) -> pb.GetRecordingResponse:
    """Returns a recording with a page of its files; on the first page with its gaps, too.

    Args:
        status_reader: has how far it has come, if it runs.
        manifest: of the recording.
        token: of the page before; empty for the first one.

    Raises:
        InvalidRequestError: the token leads to no page.
    """
    live, files = status_reader.live(manifest), manifest.files
    page = file_page([*(file.name for file in files), *([live.part] if live.part else [])], token)
    message = recording(status_reader, manifest)
    for at in page.files:
        if at < len(files):
            file = files[at]
            message.files.add(name=file.name, size=file.size, sha256=bytes.fromhex(file.sha256), final=True)
        else:
            message.files.add(name=live.part, size=live.part_bytes)
    if not token:
        message.gaps.extend(_gap(each) for each in manifest.all_gaps)
    return pb.GetRecordingResponse(recording=message, next_page_token=page.next_token)


def bundle_page(found: Bundle, page: FilePage, sums: Mapping[str, bytes]) -> pb.GetRecordingResponse:
    """Returns a run bundle with a page of its files.

    Args:
        found: the bundle.
        page: of its files.
        sums: of files by name, as far as they are known.
    """
    message = bundle(found)
    for at in page.files:
        file = found.files[at]
        sha256 = sums.get(file.name, b"")
        message.files.add(name=file.name, size=file.size, sha256=sha256, final=found.final and bool(sha256))
    return pb.GetRecordingResponse(recording=message, next_page_token=page.next_token)


def bundle(found: BundleSummary) -> pb.Recording:
    """Returns the message of a run bundle, without its files."""
    final = found.final
    message = pb.Recording(
        id=found.id,
        label=found.folder.name if found.folder.name.isprintable() else "",
        notes=_unlisted(found.unlisted),
        kind=pb.RECORDING_KIND_RUN_BUNDLE,
        state=RECORDING_STATES[found.state],
        started_unix_ms=found.started_unix_ms,
        ended_unix_ms=found.ended_ns // _NS_PER_MS if final else 0,
        duration_ms=(found.ended_ns - found.began_ns) // _NS_PER_MS,
        size=found.size,
        file_count=found.file_count,
    )
    if found.state is RecordingState.RECOVERED:
        message.stop_reason = pb.RECORDING_STOP_REASON_INTERRUPTED
    return message


def _unlisted(files: int) -> str:
    """Returns what a run bundle lacks here, so that it is not taken for whole."""
    many = f"{files} of its files are" if files > 1 else "one of its files is"
    why = "links, or names too long or not printable"
    return f"{many} not listed: {why}; copy them on the robot" if files else ""


def status(status_reader: StatusReader, settings: RecorderSettings) -> pb.RecordingStatus:
    """Returns the message of the recorder's state."""
    rates = status_reader.bytes_per_minute
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
                bytes_per_minute=rates[name],
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


class RecordingMessages:
    """Messages of recordings. Of one that has ended it is made once: it takes all files and gaps."""

    def __init__(self) -> None:
        self._made: dict[str, tuple[Manifest, pb.Recording]] = {}
        """By ID, with the manifest that the message is of."""

    def of(self, status_reader: StatusReader, manifest: Manifest) -> pb.Recording:
        """Returns the message of a recording, without its files and gaps; not to be changed."""
        if manifest.state.open:
            return recording(status_reader, manifest)
        made = self._made.get(manifest.id)
        if made is None or made[0] is not manifest:
            made = manifest, recording(status_reader, manifest)
            self._made.pop(manifest.id, None)
            self._made[manifest.id] = made
            if len(self._made) > MOST_MADE:
                del self._made[next(iter(self._made))]
        return made[1]


def watch_state(
    status_reader: StatusReader, settings: RecorderSettings, messages: RecordingMessages
) -> recorder_pb.WatchStateResponse:
    """Returns the message that the gateway watches."""
    newest = status_reader.newest
    message = recorder_pb.WatchStateResponse(
        instance_id=status_reader.run_id,
        status=status(status_reader, settings),
        newest=messages.of(status_reader, newest) if newest else None,
        messages_dropped=status_reader.dropped,
        disk_free_bytes=status_reader.room.disk.free_bytes,
        disk_size_bytes=status_reader.room.disk.size_bytes,
        disk_short=status_reader.disk_short,
        ended=[messages.of(status_reader, each) for each in status_reader.recently_ended],
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
