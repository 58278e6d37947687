"""Lifecycle of the recorder: one table of transitions.

Pure: knows no disk, thread or clock. `step` takes the present phase, an event and the time, and returns
the next phase. An event that the table does not list for the state is a defect of the caller: it raises
an error that names both.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import Final


class State(Enum):
    """State of the recorder."""

    RECOVERING = "recovering"
    """Recordings that were cut off are being made whole, at the start."""
    IDLE = "idle"
    """No recording runs; the ring may."""
    STARTING = "starting"
    """The first file of a recording is being opened."""
    RECORDING = "recording"
    """A recording is being written."""
    FINALISING = "finalising"
    """Its last file is being closed."""
    FAULTED = "faulted"
    """The disk can't be written; it is tried again."""


class Event(Enum):
    """Event that may change the state."""

    RECOVERED = "recovered"
    """What was cut off has been made whole."""
    START = "start"
    """A recording was requested, or one that was cut off goes on."""
    OPENED = "opened"
    """Its first file is open."""
    STOP = "stop"
    """It was requested to end, or has reached a limit."""
    CLOSED = "closed"
    """Its last file is final."""
    FAILURE = "failure"
    """The disk refused to write."""
    CLEARED = "cleared"
    """The disk takes data again."""


_TABLE: Final = {
    State.RECOVERING: {Event.RECOVERED: State.IDLE, Event.FAILURE: State.FAULTED},
    State.IDLE: {Event.START: State.STARTING, Event.FAILURE: State.FAULTED},
    State.STARTING: {Event.OPENED: State.RECORDING, Event.FAILURE: State.FAULTED},
    State.RECORDING: {Event.STOP: State.FINALISING, Event.FAILURE: State.FAULTED},
    # Stopped once more, while it is being closed already.
    State.FINALISING: {
        Event.STOP: State.FINALISING,
        Event.CLOSED: State.IDLE,
        Event.FAILURE: State.FAULTED,
    },
    State.FAULTED: {Event.FAILURE: State.FAULTED, Event.CLEARED: State.IDLE},
}
TRANSITIONS: Final[Mapping[State, Mapping[Event, State]]] = MappingProxyType(_TABLE)


class IllegalEventError(Exception):
    """Event without a transition from the current state."""

    def __init__(self, state: State, event: Event) -> None:
        super().__init__(f"'{event.value}' can't happen while {state.value}")
        self.state = state
        self.event = event


@dataclass(frozen=True, slots=True)
class Phase:
    """The state, and since when.

    Attributes:
        since_s: when it was entered; monotonic seconds.
    """

    state: State
    since_s: float


def step(phase: Phase, event: Event, now_s: float) -> Phase:
    """Returns the phase after an event.

    Raises:
        IllegalEventError: the state has no transition for this event.
    """
    after = TRANSITIONS[phase.state].get(event)
    if after is None:
        raise IllegalEventError(phase.state, event)
    return phase if after is phase.state else Phase(after, now_s)
