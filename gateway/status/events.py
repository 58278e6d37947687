"""What happened, in order: a ring of the newest events; every subscriber reads on at its own place.

No subscriber has a queue here. Each keeps a position and reads what came after it; one that is too slow finds
that the ring has moved on, and is told how many events it missed.
"""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from itertools import islice
from typing import Final

from common.errors import InvalidRequestError
from gateway.status.event import Event, News

KEPT: Final = 1024
"""How many events are kept; an older one is gone, its number is not used again."""
ON_OVERLAY: Final = 8
"""How many the short list of the overlay has."""


@dataclass(frozen=True, slots=True)
class OperatorEvent:
    """An event on the overlay's short list, which has its own count from 1."""

    sequence: int
    at_s: float
    message: str


@dataclass(frozen=True, slots=True)
class Position:
    """A place between two events: the one with this sequence, of this run, and the one after it."""

    run_id: str
    sequence: int


class GapReason(Enum):
    """Why events are missing."""

    NO_LONGER_KEPT = "no longer kept"
    NEW_RUN = "new run"


@dataclass(frozen=True, slots=True)
class Gap:
    """Events are missing; `missed` of this run, and of an earlier one nobody knows how many."""

    reason: GapReason
    missed: int
    position: Position


@dataclass(frozen=True, slots=True)
class Reading:
    """What comes after a position: perhaps a gap, then events, then the position to read on from."""

    gap: Gap | None
    events: tuple[Event, ...]
    position: Position


class EventLog:
    """Belongs to one event loop.

    Args:
        run_id: of this run of the gateway; another one each time.
        kept: how many events to keep.
        unix_ms: the calendar clock.
    """

    def __init__(
        self,
        run_id: str,
        kept: int = KEPT,
        unix_ms: Callable[[], int] = lambda: time.time_ns() // 1_000_000,
    ) -> None:
        self.run_id = run_id
        self._ring: deque[Event] = deque(maxlen=kept)
        self._unix_ms = unix_ms
        self._sequence = 0
        self._on_overlay: deque[OperatorEvent] = deque(maxlen=ON_OVERLAY)
        self._overlay_sequence = 0

    @property
    def sequence(self) -> int:
        """Of the newest event; 0 before the first."""
        return self._sequence

    def add(self, news: News, now_s: float) -> Event:
        """Takes one event in."""
        self._sequence += 1
        event = Event(self._sequence, now_s, self._unix_ms(), news)
        self._ring.append(event)
        if news.sentence is not None:
            self._overlay_sequence += 1
            self._on_overlay.append(OperatorEvent(self._overlay_sequence, now_s, news.sentence))
        return event

    def newest(self) -> tuple[OperatorEvent, ...]:
        """The overlay's short list, oldest first."""
        return tuple(self._on_overlay)

    def read(self, after: Position | None, at_most: int) -> Reading:
        """What a subscriber is told next.

        Args:
            after: where it stands; None for one that takes what is kept.
            at_most: events in one reading.

        Raises:
            InvalidRequestError: a place that this run has not come to.
        """
        lost = self._sequence - len(self._ring)
        here, gap = self._place(after, lost)
        events = tuple(islice(self._ring, here - lost, here - lost + at_most))
        return Reading(gap, events, Position(self.run_id, here + len(events)))

    def _place(self, after: Position | None, lost: int) -> tuple[int, Gap | None]:
        """The sequence to go on after, and the gap before it."""
        if after is None:
            return lost, None
        if after.run_id != self.run_id:
            return lost, Gap(GapReason.NEW_RUN, lost, Position(self.run_id, lost))
        if after.sequence > self._sequence:
            raise InvalidRequestError(
                f"event {after.sequence} of this run has not happened yet; the newest is {self._sequence}"
            )
        if after.sequence < lost:
            missed = lost - after.sequence
            return lost, Gap(GapReason.NO_LONGER_KEPT, missed, Position(self.run_id, lost))
        return after.sequence, None
