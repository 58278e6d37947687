"""An export and this computer's disk: it may be slow, and keeps nothing else."""

import asyncio
import hashlib
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import google_crc32c
import pytest

from console.client.exporting import Export, ExportOptions, _Partial
from console.client.results import ExportChunk, ExportHeader, RecordingFile
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
