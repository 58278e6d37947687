"""Lifecycle of the robot's connection to its fleet: one table of transitions.

Pure. The disk comes first: while the outbox can't be written, the state is FAULTED whatever the connection
is; when it can be again, the connection is looked at anew.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import Final


class State(Enum):
    """State of the connection."""

    OFFLINE = "offline"
    """The hub can't be reached; what is to be sent waits."""
    CONNECTED = "connected"
    REFUSED = "refused"
    """The hub does not accept the robot's credential."""
    FAULTED = "faulted"
    """The outbox can't be written: events stay at the gateway. The robot's state is sent all the same."""


class Event(Enum):
    """Event that may change the state."""

    CONNECTED = "connected"
    LOST = "lost"
    """The connection broke, or an attempt at one has failed."""
    REFUSED = "refused"
    DISK_FAILED = "disk failed"
    DISK_WORKS = "disk works"


_BY_CONNECTION: Final = {
    Event.CONNECTED: State.CONNECTED,
    Event.LOST: State.OFFLINE,
    Event.REFUSED: State.REFUSED,
    Event.DISK_FAILED: State.FAULTED,
}
_TABLE: Final = {
    State.OFFLINE: {**_BY_CONNECTION, Event.DISK_WORKS: State.OFFLINE},
    State.CONNECTED: {**_BY_CONNECTION, Event.DISK_WORKS: State.CONNECTED},
    State.REFUSED: {**_BY_CONNECTION, Event.DISK_WORKS: State.REFUSED},
    State.FAULTED: {**dict.fromkeys(Event, State.FAULTED), Event.DISK_WORKS: State.OFFLINE},
}
TRANSITIONS: Final[Mapping[State, Mapping[Event, State]]] = MappingProxyType(_TABLE)
"""Total: whatever happens is possible in every state."""


@dataclass(frozen=True, slots=True)
class Phase:
    """The state, and since when.

    Attributes:
        since_s: when it was entered; monotonic seconds.
    """

    state: State
    since_s: float


def step(phase: Phase, events: tuple[Event, ...], now_s: float) -> Phase:
    """Returns the phase after events that are of one instant, the disk's first."""
    after = phase.state
    for event in events:
        after = TRANSITIONS[after][event]
    return phase if after is phase.state else Phase(after, now_s)
