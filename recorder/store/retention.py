"""What is deleted first to make room. Pure."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Stored:
    """A file on the disk, which other names may share.

    Attributes:
        inode: device and number (stat(2)); the same for all names of a file.
        links: how many names it has.
        bytes: that it takes on the disk.
    """

    inode: tuple[int, int]
    links: int
    bytes: int


@dataclass(frozen=True, slots=True)
class Keepable:
    """One thing on the disk that might be deleted.

    Attributes:
        name: a recording's ID, or a ring segment's file name.
        ordinal: of two alike the one that was made first goes first; 0 if unknown: before all others.
        ended_ns: then the older one.
        ring: whether it is a segment of the ring.
        open: whether it is being written.
        pinned: whether a person has pinned it.
        to_copy: whether a copy of it is wanted and not confirmed yet.
        copied: whether a copy of it is confirmed.
        files: that it consists of.
    """

    name: str
    ended_ns: int
    ordinal: int = 0
    ring: bool = False
    open: bool = False
    pinned: bool = False
    to_copy: bool = False
    copied: bool = False
    files: tuple[Stored, ...] = ()

    @property
    def may_go(self) -> bool:
        """Whether it may be deleted at all to make room."""
        return not (self.open or self.pinned or self.to_copy)


def in_order(candidates: Iterable[Keepable]) -> list[Keepable]:
    """Returns what may be deleted: what has been copied, then the rest, then the ring; the oldest first."""
    return sorted((each for each in candidates if each.may_go), key=_rank)


def frees(order: Sequence[Keepable]) -> list[tuple[Keepable, int]]:
    """Returns what helps to make room, with the bytes that each frees when those before it are gone.

    A file takes its room until its last name is gone. What shares all of its files with something that
    stays is left out: deleting it would free nothing. A recording that frees nothing unless the ring goes
    comes after the ring: segments that it does not share may be enough.
    """
    names = _names(order)
    without_ring = _names(each for each in order if not each.ring)
    helpful = [each for each in order if _frees_any(each, names)]
    helpful.sort(key=lambda each: not each.ring and not _frees_any(each, without_ring))
    left = {file.inode: file.links for each in helpful for file in each.files}
    found = []
    for each in helpful:
        freed = 0
        for file in each.files:
            left[file.inode] -= 1
            freed += 0 if left[file.inode] else file.bytes
        found.append((each, freed))
    return found


def _names(of: Iterable[Keepable]) -> Counter[tuple[int, int]]:
    """Returns how many names each file has in these."""
    return Counter(file.inode for each in of for file in each.files)


def _frees_any(each: Keepable, names: Counter[tuple[int, int]]) -> bool:
    """Returns whether one of its files has no other names than these."""
    return any(names[file.inode] >= file.links for file in each.files)


def _rank(each: Keepable) -> tuple[int, int, int, str]:
    group = 2 if each.ring else 0 if each.copied else 1
    return group, each.ordinal, each.ended_ns, each.name
