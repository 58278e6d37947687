"""The event log: a ring of the newest events, which every subscriber reads from its own position.

Subscribers have no queue here. One that is too slow finds that the ring has moved on, and gets a gap with the
number of events it missed.
"""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from itertools import islice
from typing import Final

from common.errors import InvalidRequestError
from gateway.status.event import Event, LoggedEvent

CAPACITY: Final = 1024
"""Events that are kept; the sequence of an older one is not used again."""
ON_OVERLAY: Final = 8
"""Length of the overlay's short list."""


@dataclass(frozen=True, slots=True)
class OperatorEvent:
    """Event of the overlay's short list, which has a sequence of its own, from 1."""

    sequence: int
    at_s: float
    message: str


@dataclass(frozen=True, slots=True)
class Position:
    """Place in the log after the event with this sequence of this run."""

    run_id: str
    sequence: int


class GapReason(Enum):
    """Why events are missing."""

    NO_LONGER_KEPT = "no longer kept"
    NEW_RUN = "new run"


@dataclass(frozen=True, slots=True)
class Gap:
    """Missing events: `missed` of this run; how many of an earlier run is unknown."""

    reason: GapReason
    missed: int
    position: Position


@dataclass(frozen=True, slots=True)
class Reading:
    """Result of one read: possibly a gap, then events, then the position to continue from."""

    gap: Gap | None
    events: tuple[LoggedEvent, ...]
    position: Position


class EventLog:
    """Used on one event loop.

    Args:
        run_id: of this run of the gateway.
        capacity: how many events are kept.
        unix_ms: calendar clock.
    """

    def __init__(
        self,
        run_id: str,
        capacity: int = CAPACITY,
        unix_ms: Callable[[], int] = lambda: time.time_ns() // 1_000_000,
    ) -> None:
        self.run_id = run_id
        self._ring: deque[LoggedEvent] = deque(maxlen=capacity)
        self._unix_ms = unix_ms
        self.sequence = 0
        """Sequence of the newest event; 0 before the first."""
        self._on_overlay: deque[OperatorEvent] = deque(maxlen=ON_OVERLAY)
        self._overlay_sequence = 0

    def add(self, event: Event, now_s: float) -> LoggedEvent:
        """Appends an event, and returns it with its number."""
        self.sequence += 1
        logged = LoggedEvent(self.sequence, now_s, self._unix_ms(), event)
        self._ring.append(logged)
        if event.sentence is not None:
            self._overlay_sequence += 1
            self._on_overlay.append(OperatorEvent(self._overlay_sequence, now_s, event.sentence))
        return logged

    def newest(self) -> tuple[OperatorEvent, ...]:
        """Returns the overlay's short list, oldest first."""
        return tuple(self._on_overlay)

    def read(self, after: Position | None, limit: int) -> Reading:
        """Returns what follows a position.

        Args:
            after: None starts with the oldest event that is kept.
            limit: events per reading.

        Raises:
            InvalidRequestError: this run has not reached the position.
        """
        lost = self.sequence - len(self._ring)
        here, gap = self._locate(after, lost)
        events = tuple(islice(self._ring, here - lost, here - lost + limit))
        return Reading(gap, events, Position(self.run_id, here + len(events)))

    def _locate(self, after: Position | None, lost: int) -> tuple[int, Gap | None]:
        """Returns the sequence to continue after, and the gap before it."""
        if after is None:
            return lost, None
        if after.run_id != self.run_id:
            return lost, Gap(GapReason.NEW_RUN, lost, Position(self.run_id, lost))
        if after.sequence > self.sequence:
            raise InvalidRequestError(
                f"event {after.sequence} of this run has not happened yet; the newest is {self.sequence}"
            )
        if after.sequence < lost:
            missed = lost - after.sequence
            return lost, Gap(GapReason.NO_LONGER_KEPT, missed, Position(self.run_id, lost))
        return after.sequence, None
