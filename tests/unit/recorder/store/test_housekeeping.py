"""The room below a quota: measured without a walk through all files every two seconds."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from recorder.config import RecorderSettings
from recorder.store import housekeeping
from recorder.store.catalogue import Catalogue
from recorder.store.housekeeping import WALK_EVERY_S, Housekeeping
from recorder.store.room import Disk
from tests.support.clock import Clock

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
