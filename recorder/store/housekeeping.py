"""Keeps room on the disk: measures it, and deletes in the order of retention."""

import asyncio
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Final, TypeVar

from common.errors import TooMuchError
from common.reasons import Reason
from recorder.config import RecorderSettings
from recorder.store.catalogue import Catalogue
from recorder.store.manifest import CopyState, Manifest
from recorder.store.retention import Keepable, frees, in_order
from recorder.store.ring import Ring
from recorder.store.room import Disk, Limits, RoomToCome, disk_of, stored, used_bytes

_log = logging.getLogger(__name__)
_T = TypeVar("_T")

LEAST_ROOM: Final = 4 * 1024 * 1024
"""Without so much room no recording begins, and one that runs is stopped."""
WALK_EVERY_S: Final = 30.0
"""To sum up files for the quota takes microseconds each: of a large disk, a share of the processor."""


@dataclass(frozen=True, slots=True)
class Room:
    """The disk, as measured last.

    Attributes:
        bytes: that may still be written.
        disk: itself.
        ring_lacks_bytes: how much the ring still grows there until it holds all that is to be kept.
    """

    bytes: int = 0
    disk: Disk = field(default=Disk(0, 0))
    ring_lacks_bytes: int = 0


class Housekeeping:
    """The room below a root.

    Args:
        settings: of the program.
        catalogue: the recordings.
        ring: the ring, if there is one.
    """

    def __init__(self, settings: RecorderSettings, catalogue: Catalogue, ring: Ring | None) -> None:
        self._settings = settings
        self._catalogue = catalogue
        self._ring = ring
        self._limits = Limits(settings.room.quota_bytes, settings.room.min_free_bytes)
        self._to_come = RoomToCome()
        self._summed_at = -1
        self._deletable_bytes = 0
        self.room = Room()
        self._exact_bytes = 0
        self._used_bytes = 0
        """At the last walk, which was at `_walked_s`, when the disk had `_walked_free` bytes free."""
        self._walked_s = float("-inf")
        self._walked_free = 0

    async def measure(self, *, exact: bool = True) -> Room:
        """Measures the room anew; where that is impossible, the former one stands.

        Args:
            exact: else files are summed up every WALK_EVERY_S alone, and what the disk has less since then
                counts as written here: the room is rather too small.
        """
        before = self.room
        self.room = (
            await attempt("the room on the disk is unknown", lambda: self._measured(exact=exact)) or before
        )
        if exact or not self._limits.quota_bytes:
            self._to_come.came(self.room.bytes - self._exact_bytes)
            self._exact_bytes = self.room.bytes
        return self.room

    async def make_room(self, need: int, *, recordings: bool = True) -> bool:
        """Deletes in the order of retention until there is room; returns whether there is.

        Recordings go until there is room for what the ring still lacks, too: for itself it deletes none.
        Some file systems give the room back only later, as all do of a file that is being exported: for half
        a minute it counts as room, so that no further recording goes for it.

        Args:
            need: in bytes.
            recordings: whether they may go, too; else segments of the ring alone.
        """
        await self.measure()
        enough = need + (self.ring_claim if recordings else 0)
        if self._expected_bytes >= enough:
            return True
        deletable = await attempt(
            "what may be deleted is unknown", lambda: self._deletable(need, recordings=recordings)
        )
        for each, freed in deletable or ():
            if each.ring:
                enough = need  # Nor does a recording that comes after the ring go for it.
            if self._expected_bytes >= enough:
                break
            if await attempt(f"{each.name} stays", partial(self._let_go, each)):
                self._to_come.expect(freed, time.monotonic())
                await self.measure()
        return self._expected_bytes >= need

    async def make_ring_room(self, need: int) -> None:
        """Drops the oldest segments of a ring on a disk of its own until there is room on that one.

        Args:
            need: in bytes.
        """
        if self._ring and self._settings.ring.directory:
            await attempt("the ring's disk is not examined", lambda: self._give_way(need))

    async def need_room(self) -> None:
        """Makes room for something new.

        Raises:
            TooMuchError: nothing more may be deleted.
        """
        if not await self.make_room(LEAST_ROOM):
            raise TooMuchError(
                "the disk has no room, and nothing on it may be deleted; copy recordings and delete some",
                Reason.DISK_FULL,
            )

    @property
    def ring_claim(self) -> int:
        """What recordings leave for the ring, as long as one may be deleted for it."""
        return self.room.ring_lacks_bytes if self.deletable_bytes else 0

    @property
    def deletable_bytes(self) -> int:
        """What recordings take that may be deleted to make room; a file that several share counts once."""
        if self._summed_at != self._catalogue.revision:
            self._summed_at, self._deletable_bytes = self._catalogue.revision, self._sum_of_deletable()
        return self._deletable_bytes

    def _sum_of_deletable(self) -> int:
        recordings = list(self._catalogue.all.values())
        kept = {file.sha256 for each in recordings if not _may_go(each) for file in each.files}
        going = {file.sha256: file.size for each in recordings if _may_go(each) for file in each.files}
        return sum(size for sha256, size in going.items() if sha256 not in kept)

    def _measured(self, *, exact: bool) -> Room:
        disk = disk_of(self._settings.root)
        used = self._used(disk, exact=exact) if self._limits.quota_bytes else 0
        return Room(self._limits.room_bytes(used, disk), disk, self._ring_lacks(disk))

    def _ring_lacks(self, disk: Disk) -> int:
        if self._ring is None:
            return 0
        # What a snapshot has, too, stays when the ring lets it go: the ring takes that room anew.
        files = stored(each.path for each in list(self._ring.segments))
        if not files or files[0].inode[0] != disk.device:
            return 0
        lacks = self._ring.full_bytes() - sum(each.bytes for each in files if each.links == 1)
        # A burst of some seconds says little of an hour: the ring asks for more when it holds more.
        return max(0, min(lacks, sum(each.bytes for each in files)))

    def _used(self, disk: Disk, *, exact: bool) -> int:
        now_s = time.monotonic()
        if exact or now_s - self._walked_s >= WALK_EVERY_S:
            self._used_bytes = used_bytes(self._settings.folders)
            self._walked_s, self._walked_free = now_s, disk.free_bytes
        return self._used_bytes + max(0, self._walked_free - disk.free_bytes)

    @property
    def _expected_bytes(self) -> int:
        return self.room.bytes + self._to_come.bytes(time.monotonic())

    def _deletable(self, need: int, *, recordings: bool) -> list[tuple[Keepable, int]]:
        disk = self.room.disk
        found = [
            Keepable(each.path.name, each.ended_ns, ring=True, files=stored([each.path]))
            for each in (self._ring.segments if self._ring else ())
        ]
        if self._limits.disk_bytes(disk) < need:
            # What lies elsewhere, the ring on a tmpfs, helps where the quota alone is short.
            found = [each for each in found if all(file.inode[0] == disk.device for file in each.files)]
        if recordings:
            found += [self._keepable(manifest) for manifest in list(self._catalogue.all.values())]
        return frees(in_order(found))

    def _keepable(self, manifest: Manifest) -> Keepable:
        folder = self._catalogue.folder_of(manifest)
        return Keepable(
            manifest.id,
            manifest.ended_unix_ms,
            ordinal=manifest.ordinal,
            open=manifest.state.open,
            pinned=manifest.pinned,
            to_copy=manifest.copied.outstanding,
            copied=manifest.copied.state is CopyState.VERIFIED,
            files=stored(folder / file.name for file in manifest.files),
        )

    def _give_way(self, need: int) -> None:
        assert self._ring, "it is its disk"  # noqa: S101  # for the type checker
        disk = disk_of(self._ring.directory)
        if disk.device == disk_of(self._settings.root).device:
            return
        lacking = need - disk.free_bytes
        for segment in list(self._ring.segments):
            if lacking <= 0:
                break
            lacking -= sum(each.bytes for each in stored([segment.path]))
            self._ring.give_up(segment)

    def _let_go(self, each: Keepable) -> bool:
        """Deletes something; returns whether it was still there."""
        if manifest := self._catalogue.get(each.name):
            _log.warning("deleted %s to make room", each.name)
            self._catalogue.delete(manifest)
            return True
        return self._ring is not None and self._ring.give_up_named(each.name)


def _may_go(manifest: Manifest) -> bool:
    return not (manifest.state.open or manifest.pinned or manifest.copied.outstanding)


async def attempt(otherwise: str, work: Callable[[], _T]) -> _T | None:
    """Runs work on the disk in a thread; an error of the disk is logged with what follows from it."""
    try:
        return await asyncio.to_thread(work)
    except OSError as error:
        _log.error("%s: %s", otherwise, error)  # the text says it
        return None
