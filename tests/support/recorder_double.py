"""A double of the recorder: the real schema on a real Unix socket, recordings in memory.

    python -m tests.support.recorder_double SOCKET

It refuses what the schema says it refuses, with the same reasons. To the gateway each run is another process.
"""

import asyncio
import hashlib
import sys
import time
import uuid
from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager, AbstractContextManager
from functools import lru_cache, partial
from pathlib import Path
from subprocess import Popen
from typing import Any, Final

import google_crc32c

from common.errors import (
    ConflictError,
    DamagedError,
    InvalidRequestError,
    NotFoundError,
    PreconditionError,
    TooMuchError,
)
from common.reasons import Reason
from omniseer.gateway.v1 import recording_pb2 as pb
from omniseer.recorder.v1 import recorder_service_pb2
from omniseer.recorder.v1.recorder_service_pb2_grpc import (
    RecorderServiceServicer,
    add_RecorderServiceServicer_to_server,
)
from tests.support.module_program import module_program
from tests.support.serving import serving_on

CHUNK_BYTES: Final = 256 * 1024
PRESET: Final = "driving"
_REPORT_EVERY_S: Final = 0.5
_HOUR_MS: Final = 3_600_000


@lru_cache(maxsize=64)
def sha256(data: bytes) -> bytes:
    """The digest of a file; computed once, so that an export of a large one keeps no report waiting."""
    return hashlib.sha256(data).digest()


class RecorderDouble(RecorderServiceServicer):
    """A recorder in this process.

    Attributes:
        files: content of each recording's files, by ID and name.
        recordings: as they are listed, without files.
        report: what it reports; `changed` sends it at once.
        requests: every request that changes something, with its metadata.
        looks: names of the calls that only looked, in order.
        faults: every fault that was reported to it.
        thawed: while it is not set, no call is answered, though connections are accepted.
        flowing: while it is not set, exports rest after the chunk on its way.
        wrong_crcs: so many of the next chunks have a wrong checksum.
        wrong_digest: the digests of files are not those of their content.
        read_error: exports fail with it from this offset on.
        exports: file and offset of each export.
        sent_bytes: of all chunks.
        copy_wanted: recordings that still have to be copied.
        set_copies: every state of a copy that it was given.
        snapshots_run: how many snapshots are being made.
        files_of_page: so many files are listed at once.
        has_pages: whether it lists the others as well; recorders of former releases do not.
    """

    def __init__(self) -> None:
        self.files: dict[str, dict[str, bytes]] = {}
        self.recordings: dict[str, pb.Recording] = {}
        self.unfinal: set[str] = set()
        self.requests: list[tuple[Any, dict[str, Any]]] = []
        self.looks: list[str] = []
        self.faults: list[recorder_service_pb2.ReportFaultRequest] = []
        self.thawed, self.flowing = asyncio.Event(), asyncio.Event()
        self.thawed.set()
        self.flowing.set()
        self.wrong_crcs = 0
        self.wrong_digest = False
        self.read_error: int | None = None
        self.exports: list[tuple[str, int]] = []
        self.sent_bytes = 0
        self.copy_wanted: set[str] = set()
        self.set_copies: list[recorder_service_pb2.SetCopyRequest] = []
        self.has_ring = self.has_video = self.has_room = True
        self.files_of_page, self.has_pages = 10_000, True
        self._answers: dict[str, Any] = {}
        self._changed = asyncio.Event()
        self._count = 0
        self.report = recorder_service_pb2.WatchStateResponse(
            instance_id=uuid.uuid4().hex, messages_lost=0, disk_free_bytes=10**9, disk_size_bytes=10**10
        )
        status = self.report.status
        status.state, status.room_bytes, status.ring_s = pb.RECORDER_STATE_IDLE, 10**9, 30
        status.presets.add(name=PRESET, description="what driving needs", with_video=True, in_ring=True)

    # What tests do

    def add(self, files: dict[str, bytes], **more: Any) -> pb.Recording:
        """Adds a recording that has ended."""
        recording = self._new(pb.RECORDING_KIND_MANUAL, pb.RECORDING_STATE_COMPLETE, **more)
        recording.stop_reason = pb.RECORDING_STOP_REASON_REQUESTED
        recording.ended_unix_ms = recording.started_unix_ms + 60_000
        recording.duration_ms = 60_000
        self.files[recording.id] = files
        self._sum_up(recording)
        self.changed()
        return recording

    def changed(self) -> None:
        """Sends the report."""
        status = self.report.status
        status.recordings = len(self.recordings)
        ended = [each for each in self.recordings.values() if each.ended_unix_ms]
        del self.report.ended[:]
        self.report.ended.extend(sorted(ended, key=lambda each: each.ended_unix_ms, reverse=True)[:16])
        self._changed.set()

    def write(self, data: bytes, *, final: bool) -> None:
        """Writes one more file of the recording that runs."""
        recording = self.recordings[self.report.status.recording_id]
        name = f"data/{len(self.files[recording.id]):06}.mcap"
        self.files[recording.id][name] = data
        if not final:
            self.unfinal.add(name)
        self._sum_up(recording)
        self.report.status.size = recording.size
        self.changed()

    def end(self, reason: pb.RecordingStopReason.ValueType = pb.RECORDING_STOP_REASON_REQUESTED) -> None:
        """Ends the recording that runs."""
        recording = self.recordings[self.report.status.recording_id]
        recording.state, recording.stop_reason = pb.RECORDING_STATE_COMPLETE, reason
        recording.ended_unix_ms = time.time_ns() // 1_000_000
        self.unfinal.clear()
        self.files[recording.id].setdefault("metadata.yaml", b"rosbag2_bagfile_information: {}\n")
        self._sum_up(recording)
        status = self.report.status
        status.state, status.recording_id, status.label = pb.RECORDER_STATE_IDLE, "", ""
        status.preset, status.size, status.elapsed_ms = "", 0, 0
        self.changed()

    # RecorderService

    async def WatchState(self, _request: Any, _context: Any) -> AsyncIterator[Any]:  # noqa: N802  # grpc's name
        while True:
            await self.thawed.wait()
            self._changed.clear()
            yield self.report
            try:
                async with asyncio.timeout(_REPORT_EVERY_S):
                    await self._changed.wait()
            except TimeoutError:
                pass  # time for a sign of life

    async def StartRecording(self, request: pb.StartRecordingRequest, context: Any) -> Any:  # noqa: N802
        if answer := await self._begin(request, context):
            return answer
        self._check_preset(request.preset)
        status = self.report.status
        if status.state == pb.RECORDER_STATE_FAULTED:
            raise PreconditionError(f"it can't record: {status.last_error}", Reason.RECORDER_NOT_READY)
        if status.recording_id:
            raise PreconditionError(f"recording {status.recording_id} runs", Reason.RECORDING_RUNS)
        if request.with_video and not self.has_video:
            raise PreconditionError("this robot has no video", Reason.NO_VIDEO)
        if not self.has_room:
            raise TooMuchError("the disk is full", Reason.DISK_FULL)
        recording = self._new(
            pb.RECORDING_KIND_MANUAL,
            pb.RECORDING_STATE_RECORDING,
            label=request.label,
            notes=request.notes,
            preset=request.preset or PRESET,
        )
        status.state, status.recording_id = pb.RECORDER_STATE_RECORDING, recording.id
        status.label, status.preset = recording.label, recording.preset
        self.changed()
        answer = pb.StartRecordingResponse(message=f"{recording.id} has started", recording=recording)
        return self._remembered(request, answer)

    async def StopRecording(self, request: pb.StopRecordingRequest, context: Any) -> Any:  # noqa: N802
        if answer := await self._begin(request, context):
            return answer
        recording_id = request.recording_id or self.report.status.recording_id
        recording = self._found(recording_id)
        if recording_id == self.report.status.recording_id:
            self.end()
        answer = pb.StopRecordingResponse(message=f"{recording_id} has ended", recording=recording)
        return self._remembered(request, answer)

    async def TriggerSnapshot(self, request: pb.TriggerSnapshotRequest, context: Any) -> Any:  # noqa: N802
        if answer := await self._begin(request, context):
            return answer
        self._check_preset(request.preset)
        if not self.has_ring:
            raise PreconditionError("this robot keeps no ring", Reason.NO_RING)
        caller = dict(context.invocation_metadata())["x-caller"]
        recording = self._new(
            pb.RECORDING_KIND_SNAPSHOT, pb.RECORDING_STATE_RECORDING, label=request.label, trigger=caller
        )
        self.report.status.snapshots_pending += 1
        self.changed()
        answer = pb.TriggerSnapshotResponse(message=f"{recording.id} is being made", recording=recording)
        return self._remembered(request, answer)

    async def ListRecordings(self, request: pb.ListRecordingsRequest, _context: Any) -> Any:  # noqa: N802
        await self.thawed.wait()
        self.looks.append("ListRecordings")
        newest = sorted(self.recordings.values(), key=lambda each: each.id, reverse=True)
        if request.page_token and not request.page_token.isdecimal():
            raise InvalidRequestError("the page token is not one of this robot")
        begin = int(request.page_token or 0)
        end = begin + min(request.page_size or 50, 200)
        token = str(end) if end < len(newest) else ""
        return pb.ListRecordingsResponse(
            recordings=newest[begin:end], next_page_token=token, status=self.report.status
        )

    async def GetRecording(self, request: pb.GetRecordingRequest, _context: Any) -> Any:  # noqa: N802
        await self.thawed.wait()
        self.looks.append("GetRecording")
        recording = pb.Recording()
        recording.CopyFrom(self._found(request.recording_id))
        listed = sorted(self.files[recording.id].items())
        begin = [name for name, _ in listed].index(request.page_token) + 1 if request.page_token else 0
        end = begin + self.files_of_page
        for name, data in listed[begin:end]:
            final = name not in self.unfinal
            digest = self._digest(data) if final else b""
            recording.files.add(name=name, size=len(data), sha256=digest, final=final)
        more = listed[end - 1][0] if self.has_pages and end < len(listed) else ""
        return pb.GetRecordingResponse(recording=recording, next_page_token=more)

    async def ExportRecording(  # noqa: N802
        self, request: pb.ExportRecordingRequest, _context: Any
    ) -> AsyncIterator[pb.ExportRecordingResponse]:
        await self.thawed.wait()
        self._found(request.recording_id)
        data = self.files[request.recording_id].get(request.file)
        if data is None:
            raise NotFoundError(f"it has no file {request.file}", Reason.RECORDING_NOT_FOUND)
        if request.file in self.unfinal:
            raise PreconditionError(f"{request.file} is still written", Reason.FILE_NOT_FINAL)
        if request.expected_sha256 not in (b"", self._digest(data)):
            raise ConflictError(f"{request.file} is another one by now", Reason.RECORDING_CHANGED)
        if request.offset > len(data):
            raise InvalidRequestError(f"{request.file} has {len(data)} bytes")
        self.exports.append((request.file, request.offset))
        yield pb.ExportRecordingResponse(header=pb.ExportHeader(size=len(data), sha256=self._digest(data)))
        for offset in range(request.offset, len(data), CHUNK_BYTES):
            await self.flowing.wait()
            if request.recording_id not in self.recordings:
                raise ConflictError("the recording was deleted", Reason.RECORDING_DELETED)
            if self.read_error is not None and offset >= self.read_error:
                raise DamagedError(f"{request.file} can't be read")
            yield self._chunk(offset, data[offset : offset + CHUNK_BYTES])

    async def GetRecordingThumbnail(self, request: Any, _context: Any) -> Any:  # noqa: N802
        recording = self._found(request.recording_id)
        if not recording.video_frames:
            raise NotFoundError("it has no video", Reason.RECORDING_NOT_FOUND)
        return pb.GetRecordingThumbnailResponse(
            key_frame=b"\0\0\0\1frame", format="h264", captured_unix_ms=recording.started_unix_ms
        )

    async def PinRecording(self, request: pb.PinRecordingRequest, context: Any) -> Any:  # noqa: N802
        if answer := await self._begin(request, context):
            return answer
        recording = self._found(request.recording_id)
        if recording.kind == pb.RECORDING_KIND_RUN_BUNDLE:
            raise PreconditionError("it is read-only", Reason.RECORDING_READ_ONLY)
        recording.pinned = request.pinned
        word = "pinned" if request.pinned else "not pinned any more"
        answer = pb.PinRecordingResponse(message=f"{recording.id} is {word}", recording=recording)
        return self._remembered(request, answer)

    async def DeleteRecording(self, request: pb.DeleteRecordingRequest, context: Any) -> Any:  # noqa: N802
        if answer := await self._begin(request, context):
            return answer
        recording = self._found(request.recording_id)
        if recording.kind == pb.RECORDING_KIND_RUN_BUNDLE:
            raise PreconditionError("it is read-only", Reason.RECORDING_READ_ONLY)
        if recording.id == self.report.status.recording_id:
            raise PreconditionError("it runs", Reason.RECORDING_RUNS)
        if recording.pinned and not request.force:
            raise PreconditionError("it is pinned", Reason.RECORDING_PINNED)
        if recording.id in self.copy_wanted and not request.force:
            raise PreconditionError("it is not copied yet", Reason.RECORDING_NOT_COPIED)
        if request.expected_sha256 not in (b"", recording.sha256):
            raise PreconditionError("its content is another one", Reason.RECORDING_CHANGED)
        del self.recordings[recording.id], self.files[recording.id]
        self.changed()
        return self._remembered(request, pb.DeleteRecordingResponse(message=f"{recording.id} is deleted"))

    async def ReportFault(self, request: Any, _context: Any) -> Any:  # noqa: N802
        await self.thawed.wait()
        self.faults.append(request)
        return recorder_service_pb2.ReportFaultResponse()

    async def SetCopy(self, request: Any, _context: Any) -> Any:  # noqa: N802
        await self.thawed.wait()
        self.set_copies.append(request)
        self._found(request.recording_id).copy.CopyFrom(request.copy)
        return recorder_service_pb2.SetCopyResponse()

    # Behind them

    async def _begin(self, request: Any, context: Any) -> Any:
        await self.thawed.wait()
        self.requests.append((request, dict(context.invocation_metadata())))
        return self._answers.get(request.request_id)

    def _remembered(self, request: Any, answer: Any) -> Any:
        self._answers[request.request_id] = answer
        return answer

    def _check_preset(self, preset: str) -> None:
        if preset not in ("", PRESET):
            raise InvalidRequestError(f"there is no preset {preset}; choose {PRESET}")

    def _found(self, recording_id: str) -> pb.Recording:
        found = self.recordings.get(recording_id)
        if found is None:
            raise NotFoundError(f"there is no recording {recording_id}", Reason.RECORDING_NOT_FOUND)
        return found

    def _new(self, kind: Any, state: Any, **more: Any) -> pb.Recording:
        self._count += 1
        recording_id = more.pop("id", f"20260101T{self._count:06}Z-abc{self._count:03}")
        recording = pb.Recording(id=recording_id, kind=kind, state=state, **more)
        recording.started_unix_ms = time.time_ns() // 1_000_000 - _HOUR_MS
        self.recordings[recording.id] = recording
        self.files[recording.id] = {}
        return recording

    def _sum_up(self, recording: pb.Recording) -> None:
        files = self.files[recording.id]
        recording.size, recording.file_count = sum(map(len, files.values())), len(files)
        if recording.state == pb.RECORDING_STATE_COMPLETE:
            lines = [f"{sha256(data).hex()}  {name}\n" for name, data in sorted(files.items())]
            recording.sha256 = sha256("".join(lines).encode())

    def _digest(self, data: bytes) -> bytes:
        return bytes(32) if self.wrong_digest else sha256(data)

    def _chunk(self, offset: int, data: bytes) -> pb.ExportRecordingResponse:
        crc32c = google_crc32c.value(data)
        if self.wrong_crcs:
            self.wrong_crcs -= 1
            crc32c ^= 1
        self.sent_bytes += len(data)
        return pb.ExportRecordingResponse(chunk=pb.ExportChunk(offset=offset, data=data, crc32c=crc32c))


def serving_recorder(socket: Path, double: RecorderDouble) -> AbstractAsyncContextManager[None]:
    """Serves the double while the block lasts."""
    return serving_on(socket, partial(add_RecorderServiceServicer_to_server, double))


def recorder_process(socket: Path, megabytes: int = 0) -> AbstractContextManager[Popen[str]]:
    """A double in a process of its own, to be stopped and killed; serving when the block begins.

    Args:
        socket: where it serves.
        megabytes: size of the one recording that it has, "bulk", in one file "data/000000.mcap".
    """
    return module_program("tests.support.recorder_double", str(socket), str(megabytes), says="serving")


async def _main() -> None:
    double = RecorderDouble()
    if megabytes := int(sys.argv[2]):
        double.add({"data/000000.mcap": bytes(range(256)) * (megabytes * 4096)}, id="bulk")
    async with serving_recorder(Path(sys.argv[1]), double):
        print("serving", flush=True)
        await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(_main())
