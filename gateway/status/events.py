"""What happened that an operator should know: the newest few, numbered."""

from collections import deque
from dataclasses import dataclass
from typing import Final

KEPT: Final = 8
"""How many events are kept; an older one is gone, its number is not used again."""


@dataclass(frozen=True, slots=True)
class Event:
    """One event; `sequence` counts from 1, `at_s` is on the gateway's monotonic clock."""

    sequence: int
    at_s: float
    message: str


class EventLog:
    """A ring of the newest events."""

    def __init__(self) -> None:
        self._events: deque[Event] = deque(maxlen=KEPT)
        self._count = 0

    def add(self, message: str, now_s: float) -> None:
        """Takes one event in."""
        self._count += 1
        self._events.append(Event(self._count, now_s, message))

    def newest(self) -> tuple[Event, ...]:
        """The kept events, oldest first."""
        return tuple(self._events)
