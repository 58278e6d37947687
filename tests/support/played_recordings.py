"""A client's recordings that the test plays."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path

from console.client import ExportedRecording, ExportOptions, GatewayError, Recording
from console.client.results import (
    RecorderState,
    RecordingAnswer,
    RecordingCopy,
    RecordingCopyState,
    RecordingDeleted,
    RecordingKind,
    RecordingPage,
    RecordingPreset,
    RecordingState,
    RecordingStatus,
    RecordingStopReason,
    RecordingThumbnail,
)

DRIVING = RecordingPreset(
    name="driving",
    description="motion and state",
    with_video=True,
    bytes_per_minute=60_000_000,
    in_ring=True,
)
IDLE = RecordingStatus(
    state=RecorderState.IDLE,
    recording_id="",
    label="",
    preset="",
    elapsed_ms=0,
    size=0,
    messages_written=0,
    messages_lost=None,
    uncounted_gaps=0,
    video=False,
    bytes_per_s=0,
    room_bytes=6_000_000_000,
    room_s=None,
    ring_s=42,
    snapshots_pending=0,
    recordings=1,
    to_copy=0,
    last_error="",
    presets=(DRIVING,),
)
RECORDS = replace(
    IDLE,
    state=RecorderState.RECORDING,
    recording_id="lap",
    label="lap 1",
    preset="driving",
    elapsed_ms=125_000,
    size=40_000_000,
    video=True,
    bytes_per_s=1_000_000,
    room_s=6000,
)
ENDED = Recording(
    id="one",
    label="lap 0",
    notes="",
    kind=RecordingKind.MANUAL,
    state=RecordingState.COMPLETE,
    stop_reason=RecordingStopReason.REQUESTED,
    preset="driving",
    started_unix_ms=1_700_000_000_000,
    ended_unix_ms=1_700_000_060_000,
    started_monotonic_ns=1,
    ended_monotonic_ns=2,
    boot_id="boot",
    recorder_run_id="run",
    duration_ms=60_000,
    size=12_300_000,
    messages_written=9,
    messages_lost=0,
    uncounted_gaps=0,
    video_frames=900,
    trigger="",
    pinned=False,
    copy=RecordingCopy(state=RecordingCopyState.UNKNOWN, reason="", bytes_done=0),
    file_count=2,
    gap_count=0,
    files=(),
    gaps=(),
    sha256=b"x" * 32,
)


class PlayedRecordings:
    """Answers as the test sets it up, and records the calls."""

    def __init__(self) -> None:
        self.recordings: tuple[Recording, ...] = (ENDED,)
        self.more = ""
        self.asked: list[tuple[object, ...]] = []
        self.listings = 0
        self.refusal: GatewayError | None = None
        self.list_error: GatewayError | None = None
        self.thumbnail_error: GatewayError | None = None
        self.answers = asyncio.Event()
        self.answers.set()
        self.export: Callable[[Path, ExportOptions], Awaitable[ExportedRecording]] | None = None
        self.connections = 0

    @property
    def client(self) -> "PlayedRecordings":
        return self

    @asynccontextmanager
    async def another(self) -> AsyncIterator["PlayedRecordings"]:
        self.connections += 1
        try:
            yield self
        finally:
            self.connections -= 1

    async def list_recordings(self, page_size: int = 50, page_token: str = "") -> RecordingPage:
        assert not page_token
        self.listings += 1
        if self.list_error:
            raise self.list_error
        return RecordingPage(recordings=self.recordings[:page_size], next_page_token=self.more, status=IDLE)

    async def start_recording(self, label: str = "", *, preset: str = "") -> RecordingAnswer:
        return await self._answer("start", label, preset)

    async def stop_recording(self, recording_id: str = "") -> RecordingAnswer:
        return await self._answer("stop", recording_id)

    async def trigger_snapshot(self, label: str = "", *, pre_s: int | None = None) -> RecordingAnswer:
        return await self._answer("keep", label, pre_s)

    async def recording_thumbnail(self, recording_id: str) -> RecordingThumbnail:
        self.asked.append(("thumbnail", recording_id))
        if self.thumbnail_error:
            raise self.thumbnail_error
        return RecordingThumbnail(key_frame=b"frame", format="h264", captured_unix_ms=1)

    async def pin_recording(self, recording_id: str, pinned: bool = True) -> RecordingAnswer:
        return await self._answer("pin", recording_id, pinned)

    async def delete_recording(self, recording_id: str, *, expected_sha256: bytes = b"") -> RecordingDeleted:
        await self._answer("delete", recording_id, expected_sha256)
        return RecordingDeleted(message="it is deleted")

    async def export_recording(
        self, recording_id: str, folder: Path, options: ExportOptions | None = None
    ) -> ExportedRecording:
        self.asked.append(("export", recording_id, folder))
        assert self.export
        return await self.export(folder, options or ExportOptions())

    async def _answer(self, *asked: object) -> RecordingAnswer:
        self.asked.append(asked)
        await self.answers.wait()
        if self.refusal:
            raise self.refusal
        return RecordingAnswer(message=f"{asked[0]}: done", recording=ENDED)
