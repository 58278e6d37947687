"""What is deleted first to make room. Pure."""

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Keepable:
    """One thing on the disk that might be deleted.

    Attributes:
        name: a recording's ID, or a ring segment's file name.
        ended_ns: the older one of two alike goes first.
        ring: whether it is a segment of the ring.
        open: whether it is being written.
        pinned: whether a person has pinned it.
        to_copy: whether a copy of it is wanted and not confirmed yet.
        copied: whether a copy of it is confirmed.
    """

    name: str
    ended_ns: int
    ring: bool = False
    open: bool = False
    pinned: bool = False
    to_copy: bool = False
    copied: bool = False

    @property
    def may_go(self) -> bool:
        """Whether it may be deleted at all to make room."""
        return not (self.open or self.pinned or self.to_copy)


def in_order(candidates: Iterable[Keepable]) -> list[Keepable]:
    """Returns what may be deleted: the ring, then what has been copied, then the rest; the oldest first.

    A caller deletes one, measures, and goes on while room is short: segments may share their blocks with
    others.
    """
    return sorted((each for each in candidates if each.may_go), key=_rank)


def _rank(each: Keepable) -> tuple[int, int, str]:
    group = 0 if each.ring else 1 if each.copied else 2
    return group, each.ended_ns, each.name
