"""Lists of run bundles are read once for all who ask, and files in the background, a few bundles at once."""

import asyncio
import gc
import hashlib
import threading
import time
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from common.errors import TooMuchError
from recorder.store import bundle_reader
from recorder.store.bundle_reader import LISTED_ANEW_S, MOST_AT_ONCE, OLD_S, BundleReader
from recorder.store.readers import reader_threads
from recorder.store.run_bundles import Bundle, BundleSummary, RunBundles
from recorder.store.sums import Sums
from tests.support.clock import Clock
from tests.support.eventually import eventually

MIB = 1024 * 1024
DATA = b"x" * (2 * MIB + 5)


class CountedBundles(RunBundles):
    """On a disk that may be slow."""

    lists = 0

    def __init__(self, folders: Sequence[Path]) -> None:
        super().__init__(folders)
        self.read = threading.Event()
        """While it is not set, reading the folders takes its time."""
        self.read.set()

    def all(self) -> list[BundleSummary]:
        self.lists += 1
        assert self.read.wait(20)
        return super().all()


@dataclass
class Ground:
    reader: BundleReader
    bundles: CountedBundles
    clock: Clock

    async def bundle(self, name: str) -> Bundle:
        found = await self.reader.get(f"run-{name}")
        assert found
        return found


def add(folder: Path, data: bytes = DATA) -> None:
    folder.mkdir()
    (folder / "manifest.yaml").write_text("state: complete\n", encoding="utf-8")
    (folder / "video.ts").write_bytes(data)


@pytest.fixture
async def ground(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Ground]:
    """A robot that takes half a second for the files of a bundle, and answers before."""
    monkeypatch.setattr(bundle_reader, "ANSWER_WITHIN_S", 0.05)
    monkeypatch.setattr(bundle_reader, "ANSWER_INSTEAD_OF_OLD_WITHIN_S", 0.1)
    for number in range(MOST_AT_ONCE + 1):
        add(tmp_path / str(number))
    bundles, clock = CountedBundles((tmp_path,)), Clock()
    with reader_threads() as readers:
        sums = Sums(readers.files, max_bytes_per_s=4 * MIB)
        reader = BundleReader(bundles, readers.looks, sums, clock)
        yield Ground(reader, bundles, clock)
        await reader.close()


async def test_many_who_list_at_once_have_the_folders_read_once(ground: Ground) -> None:
    for listed in await asyncio.gather(*(ground.reader.all() for _ in range(20))):
        assert len(listed) == MOST_AT_ONCE + 1
    assert ground.bundles.lists == 1
    ground.clock.now_s += LISTED_ANEW_S + 0.1
    await ground.reader.all()
    assert ground.bundles.lists == 2


async def test_folders_that_take_long_are_read_to_their_end_although_no_caller_waits(ground: Ground) -> None:
    """The defect: the gateway gave up, which began the list anew, and recordings were not listed either."""
    ground.bundles.read.clear()
    for _ in range(3):
        with pytest.raises(TooMuchError, match="for the first time"):
            await ground.reader.all()
    impatient = asyncio.create_task(ground.reader.all())
    await asyncio.sleep(0)
    impatient.cancel()
    ground.bundles.read.set()
    assert len(await ground.reader.all()) == MOST_AT_ONCE + 1
    assert ground.bundles.lists == 1


async def test_while_folders_are_read_the_list_is_that_of_the_last_time(
    ground: Ground, tmp_path: Path
) -> None:
    assert len(await ground.reader.all()) == MOST_AT_ONCE + 1
    add(tmp_path / "new")
    ground.clock.now_s += LISTED_ANEW_S + 0.1
    ground.bundles.read.clear()
    assert len(await ground.reader.all()) == MOST_AT_ONCE + 1
    ground.bundles.read.set()

    async def listed() -> int:
        return len(await ground.reader.all())

    await eventually(listed, lambda now: now == MOST_AT_ONCE + 2, "the new one is listed")
    assert ground.bundles.lists == 2


async def test_a_list_that_is_old_is_waited_for_longer(
    ground: Ground, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bundle_reader, "ANSWER_INSTEAD_OF_OLD_WITHIN_S", 20.0)
    await ground.reader.all()
    add(tmp_path / "new")
    ground.clock.now_s += OLD_S + 0.1
    ground.bundles.read.clear()
    listing = asyncio.create_task(ground.reader.all())
    await asyncio.sleep(0)
    ground.bundles.read.set()
    assert len(await listing) == MOST_AT_ONCE + 2


async def test_of_those_who_list_only_the_first_waits_for_folders_that_take_long(
    ground: Ground, monkeypatch: pytest.MonkeyPatch
) -> None:
    await ground.reader.all()
    ground.clock.now_s += LISTED_ANEW_S + 0.1
    ground.bundles.read.clear()
    await ground.reader.all()
    monkeypatch.setattr(bundle_reader, "ANSWER_WITHIN_S", 20.0)
    ground.clock.now_s += 20.1 - LISTED_ANEW_S
    monkeypatch.setattr(bundle_reader, "OLD_S", 30.0)
    began_s = time.monotonic()
    await ground.reader.all()
    assert time.monotonic() - began_s < 10
    ground.bundles.read.set()


async def test_the_end_does_not_wait_for_folders_that_take_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A list, and a bundle that a caller who has left asked for."""
    add(tmp_path / "first")
    for number in range(300):
        (tmp_path / "first" / str(number)).touch()
    lstat, begun = Path.lstat, threading.Event()

    def slowly(self: Path) -> Any:
        begun.set()
        time.sleep(0.1)
        return lstat(self)

    monkeypatch.setattr(Path, "lstat", slowly)
    with reader_threads() as readers:
        reader = BundleReader(RunBundles((tmp_path,)), readers.looks, Sums(readers.files))
        calls = [asyncio.create_task(reader.all()), asyncio.create_task(reader.get("run-first"))]
        assert await asyncio.to_thread(begun.wait, 20)
        began_s = time.monotonic()
        for call in calls:
            call.cancel()
        await reader.close()
        await asyncio.wait(calls)
        assert time.monotonic() - began_s < 10, "reading takes 30 s"
    del calls, call
    gc.collect()
    assert not caplog.records


async def test_who_asks_again_gets_what_was_read_meanwhile(ground: Ground) -> None:
    bundle = await ground.bundle("0")
    assert "video.ts" not in await ground.reader.sums(bundle, bundle.files)

    async def sums() -> dict[str, bytes]:
        return await ground.reader.sums(bundle, bundle.files)

    found = await eventually(sums, lambda now: len(now) == 2, "all files are read")
    assert found["video.ts"] == hashlib.sha256(DATA).digest()
    assert await ground.reader.sha256(bundle, bundle.files[1]) == found["video.ts"]


async def test_more_bundles_than_permitted_are_refused_until_one_is_read(ground: Ground) -> None:
    for number in range(MOST_AT_ONCE):
        bundle = await ground.bundle(str(number))
        await ground.reader.sums(bundle, bundle.files)
    last = await ground.bundle(str(MOST_AT_ONCE))
    with pytest.raises(TooMuchError, match="try again later"):
        await ground.reader.sums(last, last.files)

    async def admitted() -> bool:
        try:
            await ground.reader.sums(last, last.files)
        except TooMuchError:
            return False
        return True

    await eventually(admitted, bool, "one of the others is read", 20)


async def test_unknown_names_are_no_bundles(ground: Ground) -> None:
    for name in ("run-none", "none", "", "../0", "run-../0"):
        assert await ground.reader.get(name) is None
