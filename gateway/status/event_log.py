"""The event log: a ring of the newest events, which every subscriber reads from its own position.

Subscribers have no queue here. One that is too slow finds that the ring has moved on, and gets a gap with the
number of events it missed. Control actions outlast the ring: callers that are refused, or come and go, can't
push out who did what to the robot.
"""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from itertools import islice
from typing import Final

from common.errors import InvalidRequestError
from gateway.status.event import ControlAction, ControlResult, Event, LoggedEvent

CAPACITY: Final = 1024
"""Events that are kept; the sequence of an older one is not used again."""
MAX_OLDER_ACTIONS: Final = 256
"""Control actions that are kept after they have left the ring; refused ones are not."""
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
        self._older: deque[LoggedEvent] = deque(maxlen=MAX_OLDER_ACTIONS)
        self._unix_ms = unix_ms
        self.sequence = 0
        """Sequence of the newest event; 0 before the first."""
        self._on_overlay: deque[OperatorEvent] = deque(maxlen=ON_OVERLAY)
        self._overlay_sequence = 0

    def add(self, event: Event, now_s: float) -> LoggedEvent:
        """Appends an event, and returns it with its number."""
        self.sequence += 1
        logged = LoggedEvent(self.sequence, now_s, self._unix_ms(), event)
        if len(self._ring) == self._ring.maxlen and _outlasts_the_ring(self._ring[0].event):
            self._older.append(self._ring[0])
        self._ring.append(logged)
        if event.sentence is not None:
            self._overlay_sequence += 1
            self._on_overlay.append(OperatorEvent(self._overlay_sequence, now_s, event.sentence))
        return logged

    def newest(self) -> tuple[OperatorEvent, ...]:
        """Returns the overlay's short list, oldest first."""
        return tuple(self._on_overlay)

    def read(self, after: Position | None, limit: int) -> Reading:
        """Returns what follows a position, up to the next gap.

        Args:
            after: None starts with the oldest event that is kept.
            limit: events per reading.

        Raises:
            InvalidRequestError: this run has not reached the position.
        """
        lost = self.sequence - len(self._ring)
        here, gap = self._locate(after, lost)
        if here >= lost:
            events = tuple(islice(self._ring, here - lost, here - lost + limit))
        else:
            following = (each for each in self._older if each.sequence > here)
            numbered = zip(range(here + 1, here + 1 + limit), following, strict=False)
            events = tuple(each for sequence, each in numbered if each.sequence == sequence)
        return Reading(gap, events, Position(self.run_id, here + len(events)))

    def _locate(self, after: Position | None, lost: int) -> tuple[int, Gap | None]:
        """Returns the sequence to continue after, and the gap before it."""
        sequence = after.sequence if after and after.run_id == self.run_id else 0
        if sequence > self.sequence:
            raise InvalidRequestError(
                f"event {sequence} of this run has not happened yet; the newest is {self.sequence}"
            )
        following = (each.sequence - 1 for each in self._older if each.sequence > sequence)
        here = next(following, max(lost, sequence))
        if after is None:
            return here, None
        if after.run_id != self.run_id:
            return here, Gap(GapReason.NEW_RUN, here, Position(self.run_id, here))
        if here > sequence:
            return here, Gap(GapReason.NO_LONGER_KEPT, here - sequence, Position(self.run_id, here))
        return here, None


def _outlasts_the_ring(event: Event) -> bool:
    action = event.detail
    return isinstance(action, ControlAction) and action.result is not ControlResult.REFUSED
