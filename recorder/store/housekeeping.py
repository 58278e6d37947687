"""Keeps room on the disk: measures it, and deletes in the order of retention."""

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, TypeVar

from common.errors import TooMuchError
from common.reasons import Reason
from recorder.config import RecorderSettings
from recorder.store.catalogue import Catalogue
from recorder.store.manifest import CopyState
from recorder.store.retention import Keepable, in_order
from recorder.store.ring import Ring
from recorder.store.room import Disk, Limits, disk_of, used_bytes

_log = logging.getLogger(__name__)
_T = TypeVar("_T")

LEAST_ROOM: Final = 4 * 1024 * 1024
"""Without so much room no recording begins, and one that runs is stopped."""


@dataclass(frozen=True, slots=True)
class Room:
    """The disk, as measured last. `bytes` may still be written."""

    bytes: int = 0
    disk: Disk = field(default=Disk(0, 0))


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
        self.room = Room()

    async def measure(self) -> Room:
        """Measures the room anew; where that is impossible, the former one stands."""
        self.room = await attempt("the room on the disk is unknown", self._measured) or self.room
        return self.room

    async def make_room(self, need: int) -> bool:
        """Deletes in the order of retention until there is room; returns whether there is."""
        await self.measure()
        for each in in_order(self._keepables()):
            if self.room.bytes >= need:
                break
            await attempt(f"{each.name} stays", lambda name=each.name: self._let_go(name))  # type: ignore[misc]
            await self.measure()
        return self.room.bytes >= need

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

    def _measured(self) -> Room:
        disk = disk_of(self._settings.root)
        used = used_bytes(self._settings.folders) if self._limits.quota_bytes else 0
        return Room(self._limits.room_bytes(used, disk), disk)

    def _keepables(self) -> list[Keepable]:
        found = [
            Keepable(each.path.name, each.ended_ns, ring=True)
            for each in (self._ring.segments if self._ring else ())
        ]
        recordings = [
            Keepable(
                manifest.id,
                manifest.ended_unix_ms,
                open=manifest.state.open,
                pinned=manifest.pinned,
                to_copy=manifest.copied.outstanding,
                copied=manifest.copied.state is CopyState.VERIFIED,
            )
            for manifest in self._catalogue.all.values()
        ]
        return found + recordings

    def _let_go(self, name: str) -> None:
        if manifest := self._catalogue.get(name):
            _log.warning("deleted %s to make room", name)
            self._catalogue.delete(manifest)
        elif self._ring:
            for segment in [each for each in self._ring.segments if each.path.name == name]:
                self._ring.drop(segment)


async def attempt(otherwise: str, work: Callable[[], _T]) -> _T | None:
    """Runs work on the disk in a thread; an error of the disk is logged with what follows from it."""
    try:
        return await asyncio.to_thread(work)
    except OSError as error:
        _log.error("%s: %s", otherwise, error)  # the text says it
        return None
