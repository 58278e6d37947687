"""How much may still be written: the quota, the space that stays free, a reserve for closing files."""

import errno
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from recorder.store.retention import Stored

_GIB: Final = 1024**3
_MIN_FREE_SHARE: Final = 0.05
RESERVE_BYTES: Final = 2 * 1024 * 1024
"""The index of a segment with some hundred channels takes some hundred KiB, a manifest less."""
_RESERVE: Final = "reserve"
_FULL: Final = (errno.ENOSPC, errno.EDQUOT)
_TO_COME_WITHIN_S: Final = 30.0
"""Btrfs frees when it commits: every 30 s by default (btrfs(5), "commit")."""
_BLOCK: Final = 512
"""Unit of st_blocks (stat(2))."""


def is_full(error: OSError) -> bool:
    """Returns whether an error means that the disk, or this user's share of it, is full."""
    return error.errno in _FULL


@dataclass(frozen=True, slots=True)
class Disk:
    """A file system.

    Attributes:
        free_bytes: available to this user.
        size_bytes: of the whole.
        device: its number (stat(2)), by which two paths are in one file system or not.
    """

    free_bytes: int
    size_bytes: int
    device: int = 0


def disk_of(path: Path) -> Disk:
    """Returns the file system that a path is in.

    Raises:
        OSError: it can't be asked.
    """
    found = os.statvfs(path)
    return Disk(found.f_bavail * found.f_frsize, found.f_blocks * found.f_frsize, path.stat().st_dev)


@dataclass(frozen=True, slots=True)
class Limits:
    """How much may be written.

    Attributes:
        quota_bytes: of everything below the root; 0 for none.
        min_free_bytes: what stays free; None for the larger of 1 GiB and 5 % of the file system.
    """

    quota_bytes: int = 0
    min_free_bytes: int | None = None

    def room_bytes(self, used_bytes: int, disk: Disk) -> int:
        """Returns how much may still be written; negative where something has to go."""
        room = self.disk_bytes(disk)
        return min(room, self.quota_bytes - used_bytes) if self.quota_bytes else room

    def disk_bytes(self, disk: Disk) -> int:
        """Returns how much the disk alone would take, whatever the quota says."""
        min_free = self.min_free_bytes
        if min_free is None:
            min_free = max(_GIB, int(disk.size_bytes * _MIN_FREE_SHARE))
        return disk.free_bytes - min_free


def used_bytes(folders: Iterable[Path]) -> int:
    """Returns what all files below take on the disk; a file with several links counts once."""
    seen: dict[tuple[int, int], int] = {}
    for folder in folders:
        for directory, _, names in os.walk(folder):
            for name in names:
                try:
                    status = os.lstat(os.path.join(directory, name))  # noqa: PTH118  # of thousands of files
                except FileNotFoundError:
                    continue  # It has gone meanwhile.
                seen[status.st_dev, status.st_ino] = status.st_blocks * _BLOCK
    return sum(seen.values())


def stored(paths: Iterable[Path]) -> tuple[Stored, ...]:
    """Returns these files as they lie on the disk, without those that are missing."""
    found = []
    for path in paths:
        try:
            status = path.lstat()
        except FileNotFoundError:
            continue
        found.append(Stored((status.st_dev, status.st_ino), status.st_nlink, status.st_blocks * _BLOCK))
    return tuple(found)


class RoomToCome:
    """What has been deleted, but the disk does not show as free yet."""

    def __init__(self) -> None:
        self._bytes = 0
        self._until_s = 0.0

    def expect(self, freed_bytes: int, now_s: float) -> None:
        """Takes note of a deletion; `now_s` are monotonic seconds."""
        self._bytes = self.bytes(now_s) + freed_bytes
        self._until_s = now_s + _TO_COME_WITHIN_S

    def came(self, more_bytes: int) -> None:
        """Takes note of room that the disk shows in addition."""
        self._bytes = max(0, self._bytes - max(0, more_bytes))

    def bytes(self, now_s: float) -> int:
        """Returns what is still to come; 0 when it has not come for half a minute."""
        return self._bytes if now_s < self._until_s else 0


class Reserve:
    """Space that is taken in advance, and given back when the disk is full: closing a file needs some.

    Args:
        root: the folder of recordings.
    """

    def __init__(self, root: Path) -> None:
        self._path = root / _RESERVE

    def take(self) -> None:
        """Takes the space, unless it is taken already.

        Raises:
            OSError: there is no such space. It also shows whether the disk can be written at all.
        """
        handle = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
        try:
            os.posix_fallocate(handle, 0, RESERVE_BYTES)
            os.pwrite(handle, b"\0", 0)
            os.fsync(handle)
        except OSError:
            self._path.unlink()
            raise
        finally:
            os.close(handle)

    def give(self) -> None:
        """Gives the space back."""
        self._path.unlink(missing_ok=True)
