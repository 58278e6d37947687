"""How many messages of a channel are missing, by the numbers that the middleware gives them. Pure.

DDS numbers the messages of each publisher (DDSI-RTPS 8.3.5.4). rclpy hands the number over, but not the
publisher. Of one publisher the count is exact. Of several, each number is taken for the next of the sequence
that it fits best: exact while their numbers are apart, close otherwise, and 0 where nothing was lost. Where
publishers come or go, numbers prove nothing for a moment: what seems to be missing then is not counted.
"""

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Final

_MAX_SEQUENCES: Final = 256
_MAX_RANGES: Final = 1024


@dataclass(slots=True)
class _Sequence:
    """The messages of one publisher."""

    last: int
    at_ns: int


@dataclass(slots=True)
class _Missing:
    """Numbers `first` to `last` of a sequence, between two messages."""

    first: int
    last: int
    began_ns: int
    ended_ns: int


@dataclass(frozen=True, slots=True)
class Lost:
    """Messages that are missing, and the log times of the messages around them."""

    messages: int
    began_ns: int
    ended_ns: int


class LossCounter:
    """Counts what is missing in one channel.

    `take` each message, in the order of reception; `collect` once in a while, with the publishers that the
    graph has by then. A message that comes late, but before the next `collect`, is not counted.
    """

    def __init__(self) -> None:
        self._sequences: list[_Sequence] = []
        self._missing: list[_Missing] = []
        self._publishers: frozenset[Hashable] | None = frozenset()

    def take(self, number: int, at_ns: int) -> None:
        """Notes a message; numbers below 1 mean that the middleware does not number messages."""
        if number < 1:
            return
        below: _Sequence | None = None
        for each in self._sequences:
            if each.last == number - 1:
                below = each
                break
            if each.last < number and (below is None or each.last > below.last):
                below = each
        if below and below.last == number - 1:
            below.last, below.at_ns = number, at_ns
        elif len(self._sequences) < self._expected:
            self._sequences.append(_Sequence(number, at_ns))
        elif below:
            self._missing.append(_Missing(below.last + 1, number - 1, below.at_ns, at_ns))
            below.last, below.at_ns = number, at_ns
            self._bound()
        elif not self._found(number):
            # Lower than all, and not late: a publisher that was started again.
            oldest = min(self._sequences, key=lambda each: each.at_ns)
            oldest.last, oldest.at_ns = number, at_ns

    def collect(self, publishers: frozenset[Hashable] | None) -> Lost | None:
        """Returns what has been missing since the last call.

        Args:
            publishers: identities of those that the graph has now; None if it can't be examined.
        """
        missing, self._missing = self._missing, []
        changed = publishers is None or publishers != self._publishers
        self._publishers = publishers
        if changed:
            self._forget_oldest(len(publishers or ()) or 1)
            return None
        if not missing:
            return None
        return Lost(
            messages=sum(each.last - each.first + 1 for each in missing),
            began_ns=min(each.began_ns for each in missing),
            ended_ns=max(each.ended_ns for each in missing),
        )

    @property
    def _expected(self) -> int:
        return min(max(len(self._publishers or ()), 1), _MAX_SEQUENCES)

    def _found(self, number: int) -> bool:
        """Removes a number from the missing ones; returns whether it was one."""
        for at, each in enumerate(self._missing):
            if each.first <= number <= each.last:
                rest = [
                    _Missing(each.first, number - 1, each.began_ns, each.ended_ns),
                    _Missing(number + 1, each.last, each.began_ns, each.ended_ns),
                ]
                self._missing[at : at + 1] = [part for part in rest if part.first <= part.last]
                return True
        return False

    def _forget_oldest(self, kept: int) -> None:
        self._sequences.sort(key=lambda each: each.at_ns)
        del self._sequences[: max(0, len(self._sequences) - kept)]

    def _bound(self) -> None:
        """Joins the oldest two ranges where there are too many; late messages of them stay counted."""
        if len(self._missing) > _MAX_RANGES:
            first, second = self._missing[:2]
            count = (first.last - first.first + 1) + (second.last - second.first + 1)
            # Numbers that no message has: below 1.
            self._missing[:2] = [_Missing(1 - count, 0, first.began_ns, second.ended_ns)]
