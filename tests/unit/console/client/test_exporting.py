"""An export and this computer's disk: it may be slow, and keeps nothing else."""

import asyncio
import hashlib
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import google_crc32c
import pytest

from console.client.errors import GatewayError, Overloaded, Refused
from console.client.exporting import Export, ExportOptions, ExportProgress, _Partial, once_read
from console.client.results import (
    ExportChunk,
    ExportHeader,
    Recording,
    RecordingFile,
    RecordingKind,
    RecordingState,
)
from tests.support.played_recordings import ENDED

DATA = b"what was recorded"
DIGEST = hashlib.sha256(DATA).digest()
RECORDING = replace(
    ENDED, files=(RecordingFile(name="data/0.mcap", size=len(DATA), sha256=DIGEST, final=True),)
)


class PlayedTransport:
    """Sends the file at once."""

    def pull(self, _method: Any, _request: bytes) -> "PlayedTransport":
        self._parts: list[Any] = [
            ExportHeader(size=len(DATA), sha256=DIGEST),
            ExportChunk(offset=0, data=DATA, crc32c=google_crc32c.value(DATA)),
        ]
        return self

    async def read(self, _within_s: float | None = None) -> Any:
        return self._parts.pop(0)

    def cancel(self) -> None:
        """Nothing is under way."""

    async def sleep(self, seconds: float) -> None:
        await asyncio.sleep(seconds)


class SlowDisk:
    """Writes when it may."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.asked, self.may = threading.Event(), threading.Event()
        self.closed = False
        append = _Partial.append

        def slow(partial: _Partial, data: bytes) -> None:
            self.asked.set()
            assert self.may.wait(10)
            self.closed = partial.stream.closed
            append(partial, data)

        monkeypatch.setattr(_Partial, "append", slow)


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> SlowDisk:
    return SlowDisk(monkeypatch)


def begin(folder: Path) -> "asyncio.Task[Any]":
    return asyncio.create_task(Export(PlayedTransport(), RECORDING, folder, ExportOptions()).run())


async def test_a_slow_disk_does_not_keep_the_loop(disk: SlowDisk, tmp_path: Path) -> None:
    export = begin(tmp_path / "copy")
    await asyncio.to_thread(disk.asked.wait, 10)
    for _ in range(3):
        await asyncio.sleep(0)  # what else runs in the loop goes on
    assert not export.done()
    disk.may.set()
    done = await export
    assert (done.files, done.size) == (1, len(DATA))
    assert (tmp_path / "copy/data/0.mcap").read_bytes() == DATA


async def test_cancelled_it_closes_the_file_only_after_the_write(disk: SlowDisk, tmp_path: Path) -> None:
    export = begin(tmp_path / "copy")
    await asyncio.to_thread(disk.asked.wait, 10)
    export.cancel()
    await asyncio.sleep(0.02)
    assert not export.done()
    disk.may.set()
    with pytest.raises(asyncio.CancelledError):
        await export
    assert not disk.closed
    assert (tmp_path / "copy/data/0.mcap.part").read_bytes() == DATA


UNREAD = replace(
    RECORDING,
    kind=RecordingKind.RUN_BUNDLE,
    files=(RecordingFile(name="video.ts", size=len(DATA), sha256=b"", final=False),),
)
READ = replace(UNREAD, files=RECORDING.files)


async def no_pause(_seconds: float) -> None:
    await asyncio.sleep(0)


async def test_an_export_waits_until_the_robot_has_read_a_run_bundle() -> None:
    answers: list[Recording | GatewayError] = [UNREAD, Overloaded("it reads others"), READ]
    shown: list[ExportProgress] = []

    async def ask(_recording_id: str) -> Recording:
        answer = answers.pop(0)
        if isinstance(answer, GatewayError):
            raise answer
        return answer

    assert await once_read(UNREAD, ask, no_pause, ExportOptions(progress=shown.append)) is READ
    assert answers == []
    assert {each.waiting for each in shown} == {"the robot reads the files"}


async def test_nothing_is_waited_for_that_does_not_come() -> None:
    async def ask(_recording_id: str) -> Recording:
        raise Refused("it was deleted")

    running = replace(UNREAD, state=RecordingState.RECORDING)
    for each in (running, READ, replace(UNREAD, kind=RecordingKind.MANUAL)):
        assert await once_read(each, ask, no_pause, ExportOptions()) is each
    with pytest.raises(Refused):
        await once_read(UNREAD, ask, no_pause, ExportOptions())
    impatient = ExportOptions(give_up_after_s=-1)
    assert await once_read(UNREAD, ask, no_pause, impatient) is UNREAD, "the copy has what can be read"
