"""How many messages of a channel are missing, by the numbers that the middleware gives them. Pure.

DDS numbers the messages of each publisher (DDSI-RTPS 8.3.5.4). rclpy hands the number over, but not the
publisher. Of one publisher the count is exact. Of several, each number is taken for the next of the sequence
that it fits best: exact while their numbers are apart, close otherwise, and 0 where nothing was lost. When
publishers have come or gone, the numbers since they were looked at last are gone through once more, as of all
that there were meanwhile. How many are missing is unknown while nothing is known of the publishers, and where
one was started again without the graph showing another one: how far the former one had come is not known.
"""

from collections import deque
from collections.abc import Hashable
from dataclasses import dataclass, replace
from typing import Final

_MAX_SEQUENCES: Final = 256
_MAX_RANGES: Final = 1024
_MAX_RECENT: Final = 100_000
"""Numbers that are kept to go through them again: those of a second, at up to 100 kHz."""
_MAX_ASIDE: Final = 10_000
"""Messages that are kept although they may be history: those of ten seconds, at up to 1 kHz."""


@dataclass(slots=True)
class _Sequence:
    """The messages of one publisher.

    Attributes:
        last: number of the newest.
        at_ns: its log time.
        published_ns: its source time; -1 if unknown.
        known: whether it was there at the last `collect`.
        ahead: whether it may have had messages of one that is known, with which it was level.
    """

    last: int
    at_ns: int
    published_ns: int
    known: bool = False
    ahead: bool = False

    @property
    def nearness(self) -> tuple[int, bool, int]:
        """The greatest is taken of those below a number: of two at the same number, the newer one.

        The other may be of a publisher that has gone.
        """
        return self.last, not self.known, self.at_ns


@dataclass(slots=True)
class _Missing:
    """Numbers `first` to `last` of a sequence, between two messages, by their log times and source times."""

    first: int
    last: int
    began_ns: int
    ended_ns: int
    published_from_ns: int
    published_until_ns: int


@dataclass(frozen=True, slots=True)
class Lost:
    """Messages that are missing, and the log times of the messages around them."""

    messages: int | None
    """None where it is unknown how many."""
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
        self._restarts: list[tuple[int, int]] = []
        """Log times of the messages around each: nothing says how many are missing of the former one."""
        self._surplus = 0
        """How many of the sequences may be those of publishers that have gone, while others stayed."""
        self._publishers: frozenset[Hashable] = frozenset()
        self._expected = 1
        """How many publishers there are, as far as is known."""
        self._before: list[_Sequence] = []
        """The sequences as they were at the last `collect`, and in `_recent` what has come since."""
        self._surplus_before = 0
        self._aside: deque[tuple[int, int, int]] = deque(maxlen=_MAX_ASIDE)
        """Number, log time and source time of those that may be history: no sequence has moved for them.

        Where one of them was live all the same, it is not missing.
        """
        self._aside_before = self._aside.copy()
        self._recent: list[tuple[int, int, int, bool, bool]] = []

    def take(
        self,
        number: int,
        at_ns: int,
        published_ns: int = -1,
        *,
        maybe_history: bool = False,
        aside: bool = False,
    ) -> None:
        """Notes a message.

        Args:
            number: of the middleware; below 1 where it does not number messages.
            at_ns: log time.
            published_ns: source time, which two messages of one number do not share; below 1 if unknown.
            maybe_history: whether it may be one that a publisher had kept, and of which newer ones are known.
            aside: whether it comes once more if it is none: it is not missing, and no sequence moves for it.
        """
        if number < 1:
            return
        if len(self._recent) <= _MAX_RECENT:
            self._recent.append((number, at_ns, published_ns, maybe_history, aside))
        self._take(number, at_ns, published_ns, maybe_history, aside)

    def _take(self, number: int, at_ns: int, published_ns: int, maybe_history: bool, aside: bool) -> None:
        if aside:
            self._set_aside(number, at_ns, published_ns)
            return
        below: _Sequence | None = None
        for each in self._sequences:
            if each.last == number and each.published_ns == published_ns > 0:
                return  # The same once more: what a transient local publisher keeps for late subscribers.
            if each.last < number and (below is None or each.nearness > below.nearness):
                below = each
        if below and below.last == number - 1:
            if not below.known and any(each.known and each.last == below.last for each in self._sequences):
                below.ahead = True
            self._advance(below, number, at_ns, published_ns)
        elif maybe_history and any(_is_older(number, published_ns, each) for each in self._sequences):
            self._set_aside(number, at_ns, published_ns)
        elif len(self._sequences) < self._expected:
            self._sequences.append(_Sequence(number, at_ns, published_ns))
        elif below:
            between = [each for each in self._aside if each[0] < number and each[2] <= published_ns]
            for each in sorted(each for each in between if _may_follow(below, *each)):
                self._advance(below, *each)
            self._advance(below, number, at_ns, published_ns)
        elif not self._found(number, published_ns):
            self._restart(number, at_ns, published_ns)

    def collect(self, publishers: frozenset[Hashable] | None) -> Lost | None:
        """Returns what has been missing since the last call.

        Args:
            publishers: identities of those that the graph has now; None if it can't be examined.
        """
        exact = publishers is not None
        # While the graph shows no publisher, the former ones stay known.
        if publishers and publishers != self._publishers:
            exact = len(self._recent) <= _MAX_RECENT
            if exact:
                self._go_through_again(publishers | self._publishers)
            self._expect(publishers)
        missing, self._missing = self._missing, []
        restarts, self._restarts = self._restarts, []
        for each in self._sequences:
            each.known, each.ahead = True, False
        self._before, self._surplus_before = [replace(each) for each in self._sequences], self._surplus
        self._aside = deque(
            (note for note in self._aside if any(_may_follow(each, *note) for each in self._sequences)),
            maxlen=_MAX_ASIDE,
        )
        self._aside_before = self._aside.copy()
        self._recent.clear()
        times = [*((each.began_ns, each.ended_ns) for each in missing), *restarts]
        if not times:
            return None
        return Lost(
            messages=sum(each.last - each.first + 1 for each in missing) if exact and not restarts else None,
            began_ns=min(began_ns for began_ns, _ in times),
            ended_ns=max(ended_ns for _, ended_ns in times),
        )

    def _go_through_again(self, publishers: frozenset[Hashable]) -> None:
        """Takes what has come since the last `collect` for messages of these publishers."""
        self._sequences = [replace(each) for each in self._before]
        self._missing, self._restarts, self._surplus = [], [], self._surplus_before
        self._aside = self._aside_before.copy()
        self._expected = _bounded(len(publishers))
        for message in self._recent:
            self._take(*message)

    def _expect(self, publishers: frozenset[Hashable]) -> None:
        """Knows the publishers from now on; forgets the oldest sequences of those that have gone."""
        gone = len(self._publishers - publishers)
        none_stays = bool(self._publishers) and self._publishers.isdisjoint(publishers)
        self._publishers, self._expected = publishers, _bounded(len(publishers))
        if none_stays:
            # Of a publisher that has taken the place of another, nothing is known but what it has sent since;
            # and of that it is not known how much is the other's where they were level.
            new = [each for each in self._sequences if not each.known]
            gone -= len(self._sequences) - len(new) - sum(each.ahead for each in new)
            self._sequences = new
        surplus = max(0, len(self._sequences) - self._expected)
        self._sequences.sort(key=lambda each: each.at_ns)
        del self._sequences[:surplus]
        # Which ones they are is not known: one that was kept may be of a publisher that has gone.
        self._surplus = max(surplus, min(gone + self._surplus, len(self._sequences)))

    def _set_aside(self, number: int, at_ns: int, published_ns: int) -> None:
        """Keeps a message that may be history, unless it was missing."""
        if not self._found(number, published_ns):
            self._aside.append((number, at_ns, published_ns))

    def _advance(self, sequence: _Sequence, number: int, at_ns: int, published_ns: int) -> None:
        """Takes a message for the newest of a sequence: the numbers before it are missing."""
        if number > sequence.last + 1:
            self._missing.append(
                _Missing(
                    sequence.last + 1, number - 1, sequence.at_ns, at_ns, sequence.published_ns, published_ns
                )
            )
            self._bound()
        sequence.last, sequence.at_ns, sequence.published_ns = number, at_ns, published_ns

    def _restart(self, number: int, at_ns: int, published_ns: int) -> None:
        """Takes a message that is lower than all, and not late: a publisher was started again."""
        oldest = min(self._sequences, key=lambda each: each.at_ns)
        if self._surplus:
            self._surplus -= 1  # Or it is one whose sequence was taken for that of a publisher that has gone.
        elif len(self._restarts) < _MAX_RANGES:
            self._restarts.append((oldest.at_ns, at_ns))
        self._sequences.remove(oldest)
        self._sequences.append(_Sequence(number, at_ns, published_ns))

    def _found(self, number: int, published_ns: int) -> bool:
        """Removes a message from the missing ones; returns whether it was one."""
        for at, each in enumerate(self._missing):
            in_time = published_ns < 1 or each.published_from_ns <= published_ns <= each.published_until_ns
            if each.first <= number <= each.last and in_time:
                rest = [replace(each, last=number - 1), replace(each, first=number + 1)]
                self._missing[at : at + 1] = [part for part in rest if part.first <= part.last]
                return True
        return False

    def _bound(self) -> None:
        """Joins the oldest two ranges where there are too many; late messages of them stay counted."""
        if len(self._missing) > _MAX_RANGES:
            first, second = self._missing[:2]
            count = (first.last - first.first + 1) + (second.last - second.first + 1)
            # Numbers that no message has: below 1.
            self._missing[:2] = [replace(first, first=1 - count, last=0, ended_ns=second.ended_ns)]


def _is_older(number: int, published_ns: int, sequence: _Sequence) -> bool:
    """Returns whether a message is from before the newest of a sequence, by number and by source time."""
    return number <= sequence.last and 0 < published_ns <= sequence.published_ns


def _may_follow(sequence: _Sequence, number: int, _at_ns: int, published_ns: int) -> bool:
    """Returns whether a message is from after the newest of a sequence, by number and by source time."""
    return number > sequence.last and published_ns >= sequence.published_ns


def _bounded(publishers: int) -> int:
    return min(max(publishers, 1), _MAX_SEQUENCES)
