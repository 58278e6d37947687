"""The room below a quota: measured without a walk through all files every two seconds."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from recorder.config import RecorderSettings
from recorder.mcap.writer import SegmentWriter
from recorder.store import housekeeping
from recorder.store.catalogue import Catalogue
from recorder.store.housekeeping import WALK_EVERY_S, Housekeeping
from recorder.store.ring import Ring
from recorder.store.room import Disk
from tests.support.clock import Clock
from tests.support.segments import string_sample

MIB = 1024 * 1024


class Ground:
    """A disk that the test fills, and a count of the walks through it."""

    def __init__(self, root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.free = 1000 * MIB
        self.used = 20 * MIB
        self.walks = 0
        self.clock = Clock()
        monkeypatch.setattr(housekeeping, "disk_of", lambda _path: Disk(self.free, 2000 * MIB))
        monkeypatch.setattr(housekeeping, "used_bytes", self._walk)
        monkeypatch.setattr(housekeeping, "time", SimpleNamespace(monotonic=self.clock))
        values: dict[str, Any] = {"root": root, "room": {"min_free_bytes": 0, "quota_bytes": 100 * MIB}}
        self.housekeeping = Housekeeping(RecorderSettings(**values), Catalogue(root), None)

    def _walk(self, _folders: object) -> int:
        self.walks += 1
        return self.used

    async def room(self, *, exact: bool) -> int:
        return (await self.housekeeping.measure(exact=exact)).bytes

    def write(self, size: int) -> None:
        self.free -= size
        self.used += size


async def test_between_two_walks_the_room_shrinks_by_what_the_disk_has_less(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ground = Ground(tmp_path, monkeypatch)
    assert await ground.room(exact=False) == 80 * MIB
    for written in range(1, 6):
        ground.write(MIB)
        assert await ground.room(exact=False) == (80 - written) * MIB
    assert ground.walks == 1
    ground.free -= 10 * MIB  # another program's
    assert await ground.room(exact=False) == 65 * MIB
    assert await ground.room(exact=True) == 75 * MIB, "before anything is deleted, it is measured exactly"
    assert ground.walks == 2


async def test_what_was_deleted_is_found_by_the_next_walk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ground = Ground(tmp_path, monkeypatch)
    assert await ground.room(exact=False) == 80 * MIB
    ground.write(-10 * MIB)
    assert await ground.room(exact=False) == 80 * MIB
    ground.clock.now_s += WALK_EVERY_S
    assert await ground.room(exact=False) == 90 * MIB


class Apart:
    """A ring of two segments on a disk of its own, beside that of the recordings."""

    def __init__(self, directory: Path, monkeypatch: pytest.MonkeyPatch, quota_bytes: int = 0) -> None:
        self.free = {"root": 1000 * MIB, "ring": 1000 * MIB}
        self.used = 0
        root, ring = directory / "root", directory / "ring"
        root.mkdir()
        ring.mkdir()
        for number in range(2):
            writer = SegmentWriter(ring / f"{number:08d}.mcap.part")
            writer.write(replace(string_sample(number), log_time_ns=(number + 1) * 1_000_000_000))
            writer.finish()
        self.ring = Ring(ring, 60)
        self.ring.load()
        monkeypatch.setattr(housekeeping, "disk_of", self._disk)
        monkeypatch.setattr(housekeeping, "used_bytes", lambda _folders: self.used)
        values: dict[str, Any] = {
            "root": root,
            "ring": {"preset": "driving", "directory": ring},
            "room": {"min_free_bytes": 0, "quota_bytes": quota_bytes},
        }
        self.housekeeping = Housekeeping(RecorderSettings(**values), Catalogue(root), self.ring)

    def _disk(self, path: Path) -> Disk:
        # That of the ring is the real one, as its files say.
        device = path.stat().st_dev + (path.name == "root")
        return Disk(self.free[path.name], 2000 * MIB, device)

    @property
    def numbers(self) -> list[int]:
        return [each.number for each in self.ring.segments]


async def test_a_ring_on_another_disk_makes_no_room_on_that_of_the_recordings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The defect: its files counted as room to come, and recordings that might have gone stayed."""
    ground = Apart(tmp_path, monkeypatch)
    ground.free["root"] = 1
    assert not await ground.housekeeping.make_room(2)
    assert ground.numbers == [0, 1]


async def test_a_ring_on_another_disk_counts_for_the_quota(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ground = Apart(tmp_path, monkeypatch, quota_bytes=MIB)
    ground.used = MIB
    assert await ground.housekeeping.make_room(2)
    assert ground.numbers == [1]


async def test_a_ring_gives_way_on_its_own_disk_as_much_as_is_needed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ground = Apart(tmp_path, monkeypatch)
    ground.free["root"] = 0
    await ground.housekeeping.make_ring_room(1000 * MIB)
    assert ground.numbers == [0, 1]
    await ground.housekeeping.make_ring_room(1000 * MIB + 1)
    assert ground.numbers == [1]
