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
from recorder.store.manifest import Kind, Manifest, RecordingState
from recorder.store.ring import Ring, RingSegment, link_next
from recorder.store.room import Disk
from recorder.values import SegmentSummary
from tests.support.clock import Clock
from tests.support.segments import string_sample

MIB = 1024 * 1024
SEGMENT_NS = 10 * 1_000_000_000


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


class Together:
    """A ring of up to six segments of 100 KB, beside recordings of 300 KB, on a full disk."""

    def __init__(
        self, root: Path, monkeypatch: pytest.MonkeyPatch, *, held: int = 1, pinned: bool = False
    ) -> None:
        disk = Disk(0, 2000 * MIB, root.stat().st_dev)
        monkeypatch.setattr(housekeeping, "disk_of", lambda _path: disk)
        self.catalogue = Catalogue(root)
        for number in range(1, 5):
            manifest = Manifest(
                id=f"20260101T00000{number}Z-aaaaaa",
                ordinal=number,
                kind=Kind.MANUAL,
                state=RecordingState.COMPLETE,
                pinned=pinned,
            )
            folder = self.catalogue.create(manifest)
            summary = self._summary(folder / "data" / "000000.mcap", 300_000, number)
            self.catalogue.write(manifest.with_segment("data/000000.mcap", summary))
        (root / "ring").mkdir()
        self.ring = Ring(root / "ring", 60)
        for number in range(held):
            began_ns = number * SEGMENT_NS
            summary = self._summary(root / "ring" / Ring.name(number), 100_000, 0)
            self.ring.add(RingSegment(number, began_ns, began_ns + SEGMENT_NS, 0, summary))
        values: dict[str, Any] = {
            "root": root,
            "ring": {"preset": "driving"},
            "room": {"min_free_bytes": 0},
        }
        self.housekeeping = Housekeeping(RecorderSettings(**values), self.catalogue, self.ring)

    def incident(self) -> Manifest:
        """Makes an incident that has the oldest segment of the ring."""
        manifest = Manifest(
            id="20260101T000009Z-aaaaaa", ordinal=9, kind=Kind.INCIDENT, state=RecordingState.COMPLETE
        )
        made = link_next(self.catalogue.create(manifest), manifest, self.ring.segments[0])
        self.catalogue.write(made)
        return made

    @staticmethod
    def _summary(path: Path, size: int, number: int) -> SegmentSummary:
        path.write_bytes(bytes([number]) * size)
        return SegmentSummary(path, size, f"{number:064x}", 1, (), 0, SEGMENT_NS, ())


async def test_recordings_leave_the_ring_the_room_that_it_lacks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ground = Together(tmp_path, monkeypatch)
    assert await ground.housekeeping.make_room(250_000)
    assert [each.ordinal for each in ground.catalogue.all.values()] == [3, 4]
    assert len(ground.ring.segments) == 1


@pytest.mark.parametrize(("held", "claim"), [(1, 1), (2, 2), (4, 2), (6, 0)])
async def test_the_ring_claims_what_it_lacks_but_no_more_than_it_holds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, held: int, claim: int
) -> None:
    ground = Together(tmp_path, monkeypatch, held=held)
    await ground.housekeeping.measure()
    assert ground.housekeeping.ring_claim == pytest.approx(claim * 100_000, rel=0.1)


async def test_a_ring_that_lacks_room_costs_nothing_where_no_recording_may_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ground = Together(tmp_path, monkeypatch, pinned=True)
    await ground.housekeeping.measure()
    assert ground.housekeeping.ring_claim == 0
    assert not await ground.housekeeping.make_room(200_000)
    assert len(ground.catalogue.all) == 4
    assert ground.ring.segments == [], "it goes before a recording is refused"


async def test_the_ring_alone_deletes_no_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ground = Together(tmp_path, monkeypatch)
    assert await ground.housekeeping.make_room(50_000, recordings=False)
    assert len(ground.catalogue.all) == 4
    assert ground.ring.segments == []


async def test_an_incident_that_is_all_in_the_ring_goes_after_the_ring(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The defect: the newest incident was deleted before the ring, and freed nothing."""
    ground = Together(tmp_path, monkeypatch, held=3, pinned=True)
    incident = ground.incident()
    assert await ground.housekeeping.make_room(50_000)
    assert ground.catalogue.get(incident.id)
    assert [each.number for each in ground.ring.segments] == [2]
    assert await ground.housekeeping.make_room(250_000)
    assert ground.catalogue.get(incident.id) is None
    assert len(ground.catalogue.all) == 4


async def test_an_incident_that_is_all_in_the_ring_does_not_go_for_the_ring(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ground = Together(tmp_path, monkeypatch, held=2, pinned=True)
    incident = ground.incident()
    await ground.housekeeping.measure()
    assert ground.housekeeping.ring_claim > 0
    assert await ground.housekeeping.make_room(100_000)
    assert ground.catalogue.get(incident.id), "there is room but for what the ring lacks"
    assert ground.ring.segments == []


async def test_a_ring_that_gives_way_has_no_hole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The defect: what an incident has stayed, and a later snapshot had it, but not what followed."""
    ground = Together(tmp_path, monkeypatch, held=4)
    incident = ground.incident()
    assert await ground.housekeeping.make_room(50_000, recordings=False)
    assert [each.number for each in ground.ring.segments] == [2, 3]
    kept = ground.catalogue.folder_of(incident) / incident.files[0].name
    assert kept.stat().st_nlink == 1
    assert not (tmp_path / "ring" / Ring.name(0)).exists()


async def test_what_snapshots_have_of_the_ring_is_lacking_as_well(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ground = Together(tmp_path, monkeypatch, held=6)
    await ground.housekeeping.measure()
    assert ground.housekeeping.ring_claim == 0
    for each in ground.ring.segments[:3]:
        (tmp_path / each.path.name).hardlink_to(each.path)
    await ground.housekeeping.measure()
    assert ground.housekeeping.ring_claim == pytest.approx(300_000, rel=0.1)
