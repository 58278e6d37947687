"""How many messages of a channel are missing, by the numbers that the middleware gives them. Pure.

DDS numbers the messages of each publisher (DDSI-RTPS 8.3.5.4). rclpy hands the number over, but not the
publisher. Of one publisher the count is exact. Of several, each number is taken for the next of the sequence
that it fits best: exact while their numbers are far apart, once each was heard and while none joins or
leaves, and close otherwise, mostly. Where nothing was lost it is 0, but for rare cases of late history.

A publisher that has gone counts as one that is silent, until all that are there were heard: which sequence
was its own is not known. One that left without a message is forgotten when the graph is looked at next. When
the graph shows others, the numbers since it was looked at last are gone through once more, as of all that
there were meanwhile. A message that may be history, and is older than the newest of a sequence, moves none:
it is set aside, and is no part of a gap that it fits.

How many are missing is unknown while nothing is known of the publishers, and where one was started again
without the graph showing another one: how far the former one had come is not known.
"""

from collections import deque
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from enum import Enum, auto
from itertools import islice
from typing import Final

_MAX_SEQUENCES: Final = 256
_MAX_GONE: Final = 16
"""Publishers that are remembered after they have gone: those that went last."""
_MAX_RANGES: Final = 1024
_MAX_RECENT: Final = 100_000
"""Numbers that are kept to go through them again: those of a second, at up to 100 kHz."""
_MAX_ASIDE: Final = 5_000
"""Messages that are kept although they may be history: those of ten seconds, at up to 500 Hz."""
_MAX_COMPARED: Final = 20
"""With more sequences, no such message is kept: each would be compared with each of them, time and again."""

_Message = tuple[int, int, int]
"""Number, log time and source time."""


class Kind(Enum):
    """What is known of a message beside its number and its times."""

    LIVE = auto()
    MAYBE_HISTORY = auto()
    """A publisher may have kept it, and newer ones of that publisher may be known."""
    ASIDE = auto()
    """It may be history, too, and comes once more if it is live: it is not missing, and moves no sequence."""


@dataclass(slots=True)
class _Sequence:
    """The messages of one publisher.

    Attributes:
        last: number of the newest.
        at_ns: its log time.
        published_ns: its source time; -1 if unknown.
        heard: whether its publisher is there for certain: this sequence has gone on since the graph was found
            unchanged, and what publishers that have gone had sent came before that.
    """

    last: int
    at_ns: int
    published_ns: int
    heard: bool = False


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
        self._publishers: dict[Hashable, int] = {}
        """Those that the graph has, and how many sequences had begun for certain before each appeared."""
        self._gone: dict[Hashable, int] = {}
        """Those that have gone, likewise: their sequences may still be there, which ones is not known."""
        self._begun = 0
        """How many sequences have begun so far: none of a publisher that has sent nothing."""
        self._begun_before = 0
        """As it was at the last `collect`."""
        self._begun_known = 0
        """As it was at the last `collect` with publishers."""
        self._settled = False
        """Whether none had come or gone at the last `collect`."""
        self._expected = 1
        """How many sequences there are at most, as far as is known."""
        self._before: list[_Sequence] = []
        """The sequences as they were at the last `collect`; in `_recent` is what has come since."""
        self._aside: deque[_Message] = deque(maxlen=_MAX_ASIDE)
        """Messages that may be history, and that no sequence has moved for.

        Where a sequence goes on beyond some of them that fit it, these were live, and are not missing.
        """
        self._aside_before = self._aside.copy()
        self._recent: list[tuple[_Message, Kind]] = []

    def take(self, number: int, at_ns: int, published_ns: int = -1, kind: Kind = Kind.LIVE) -> None:
        """Notes a message.

        Args:
            number: of the middleware; below 1 where it does not number messages.
            at_ns: log time.
            published_ns: source time, which two messages of one number do not share; below 1 if unknown.
            kind: whether it may be history.
        """
        if number < 1:
            return
        message = number, at_ns, published_ns
        if len(self._recent) <= _MAX_RECENT:
            self._recent.append((message, kind))
        if kind is Kind.LIVE and (sequence := self._followed_by(number)):
            self._advance(sequence, message)  # As nearly always: as `_take` does, without its comparisons.
        else:
            self._take(message, kind)

    def _followed_by(self, number: int) -> _Sequence | None:
        """Returns the only sequence whose next number it is, unless it is the newest of another one."""
        found = None
        for each in self._sequences:
            if each.last == number or (found and each.last == number - 1):
                return None
            if each.last == number - 1:
                found = each
        return found

    def _take(self, message: _Message, kind: Kind) -> None:
        number, at_ns, published_ns = message
        if kind is Kind.ASIDE:
            self._set_aside(message)
            return
        if any(each.last == number and each.published_ns == published_ns > 0 for each in self._sequences):
            return  # The same once more: what a transient local publisher keeps for late subscribers.
        maybe_history = kind is Kind.MAYBE_HISTORY
        if maybe_history and any(_is_older(message, each) for each in self._sequences):
            self._set_aside(message)
            return
        may_be_first = len(self._sequences) < self._expected
        below = [each for each in self._sequences if each.last < number]
        if maybe_history:
            in_time = [each for each in below if each.published_ns <= published_ns]
            below = in_time if in_time or may_be_first else below
        nearest, between = self._nearest(below, message)
        if nearest and (nearest.last + len(between) == number - 1 or not may_be_first):
            self._advance(nearest, *between, message)
        elif may_be_first:
            self._sequences.append(_Sequence(number, at_ns, published_ns, self._settled))
            self._begun += 1
            if len(self._sequences) > _MAX_COMPARED:
                self._aside.clear()
        elif not self._found(message):
            self._restart(message)

    def collect(self, publishers: frozenset[Hashable] | None) -> Lost | None:
        """Returns what has been missing since the last call.

        Args:
            publishers: identities of those that the graph has now; None if it can't be examined.
        """
        exact = publishers is not None
        self._settled = publishers == self._publishers.keys()
        # While the graph shows no publisher, the former ones stay known.
        if publishers and not self._settled:
            exact = len(self._recent) <= _MAX_RECENT
            self._expect(publishers, again=exact)
        elif self._settled:
            self._forget_what_has_gone()
            self._expected = self._at_most()
        missing, self._missing = self._missing, []
        restarts, self._restarts = self._restarts, []
        self._before, self._begun_before = [replace(each) for each in self._sequences], self._begun
        if publishers:
            self._begun_known = self._begun
        self._aside = deque(
            (aside for aside in self._aside if any(_may_follow(each, aside) for each in self._sequences)),
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

    def _expect(self, publishers: frozenset[Hashable], *, again: bool) -> None:
        """Knows the publishers from now on.

        Args:
            publishers: those that there are now.
            again: whether to go through what has come since the last `collect` once more, as of all that
                there were meanwhile.
        """
        known = self._gone | self._publishers
        if again:
            self._expected = _bounded(len(publishers | known.keys()))
            self._sequences, self._begun = [replace(each) for each in self._before], self._begun_before
            self._missing, self._restarts, self._aside = [], [], self._aside_before.copy()
            for message, kind in self._recent:
                self._take(message, kind)
        gone = {each: begun for each, begun in known.items() if each not in publishers}
        self._gone = _newest(gone, _MAX_GONE)
        self._publishers = {each: known.get(each, self._begun_known) for each in publishers}
        self._expected = self._at_most()
        self._sequences.sort(key=lambda each: each.at_ns)
        # A publisher that is forgotten takes a sequence with it: those that join would find no room.
        forgotten = max(len(gone) - len(self._gone), len(self._sequences) - self._expected)
        del self._sequences[: max(0, forgotten)]
        for each in self._sequences:
            each.heard = False

    def _forget_what_has_gone(self) -> None:
        """Forgets the sequences of publishers that have gone, once all that are there were heard since.

        Publishers that have gone, and that no sequence can be of, are forgotten in any case.
        """
        heard = [each for each in self._sequences if each.heard]
        if self._gone and len(heard) >= _bounded(len(self._publishers)):
            self._sequences, self._gone = heard, {}
        # One that has sent nothing has no sequence.
        sent = {each: begun for each, begun in self._gone.items() if begun < self._begun}
        self._gone = _newest(sent, len(self._sequences))

    def _at_most(self) -> int:
        """Returns how many sequences there can be: of the publishers, and of those that have gone."""
        return _bounded(len(self._publishers) + len(self._gone))

    def _set_aside(self, message: _Message) -> None:
        """Keeps a message that may be history, unless it was missing."""
        if not self._found(message) and len(self._sequences) <= _MAX_COMPARED:
            self._aside.append(message)

    def _nearest(
        self, below: Sequence[_Sequence], message: _Message
    ) -> tuple[_Sequence | None, list[_Message]]:
        """Returns the one of these that lacks the least up to a message, and what was set aside of that."""
        number, _, published_ns = message
        nearest = max(below, key=lambda each: (each.last, _likeness(each, published_ns)), default=None)
        if nearest is None or nearest.last == number - 1 or not self._aside:
            return nearest, []
        aside = sorted(each for each in self._aside if each[0] < number and each[2] <= published_ns)
        ways = [
            (each, list({other[0]: other for other in aside if _may_follow(each, other)}.values()))
            for each in below
        ]
        return max(ways, key=lambda way: (way[0].last + len(way[1]), _likeness(way[0], published_ns)))

    def _advance(self, sequence: _Sequence, *messages: _Message) -> None:
        """Takes messages for the newest of a sequence: the numbers between them are missing."""
        if self._settled and sequence.last + len(messages) == messages[-1][0]:
            sequence.heard = True
        for number, at_ns, published_ns in messages:
            if number > sequence.last + 1:
                times = sequence.at_ns, at_ns, sequence.published_ns, published_ns
                self._missing.append(_Missing(sequence.last + 1, number - 1, *times))
                self._bound()
            sequence.last, sequence.at_ns, sequence.published_ns = number, at_ns, published_ns

    def _restart(self, message: _Message) -> None:
        """Takes a message that is lower than all, and not late: a publisher was started again."""
        number, at_ns, published_ns = message
        oldest = min(self._sequences, key=lambda each: each.at_ns)
        if len(self._restarts) < _MAX_RANGES:
            self._restarts.append((oldest.at_ns, at_ns))
        oldest.last, oldest.at_ns, oldest.published_ns = number, at_ns, published_ns
        oldest.heard = self._settled
        self._begun += 1

    def _found(self, message: _Message) -> bool:
        """Removes a message from the missing ones; returns whether it was one."""
        number, _, published_ns = message
        for at, each in enumerate(self._missing):
            # The number alone says it of one publisher, whose clock may have been set meanwhile.
            in_time = (
                self._expected == 1
                or published_ns < 1
                or each.published_from_ns <= published_ns <= each.published_until_ns
            )
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


def _is_older(message: _Message, sequence: _Sequence) -> bool:
    """Returns whether a message is from before the newest of a sequence, by number and by source time."""
    number, _, published_ns = message
    return number <= sequence.last and 0 < published_ns <= sequence.published_ns


def _likeness(sequence: _Sequence, published_ns: int) -> tuple[bool, int, bool]:
    """Returns what is greatest of the sequence whose next message it is, of those that a number fits equally.

    It is the one whose source time is before the message's and the later one, because clocks may differ; then
    the one that is heard, because the other may be of a publisher that has gone.
    """
    return sequence.published_ns <= published_ns, sequence.published_ns, sequence.heard


def _may_follow(sequence: _Sequence, message: _Message) -> bool:
    """Returns whether a message is from after the newest of a sequence, by number and by source time."""
    number, _, published_ns = message
    return number > sequence.last and published_ns >= sequence.published_ns


def _newest(gone: dict[Hashable, int], count: int) -> dict[Hashable, int]:
    """Returns as many of the publishers that went last."""
    return dict(islice(gone.items(), max(0, len(gone) - count), None))


def _bounded(publishers: int) -> int:
    """Returns how many sequences so many publishers have at most: one at least, as messages do come."""
    return min(max(publishers, 1), _MAX_SEQUENCES)
