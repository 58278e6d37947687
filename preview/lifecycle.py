"""The life of the preview: every transition in one table, when to try again, what was counted.

Nothing here knows a pipeline, an encoder or a clock. The manager tells what happened, the table says what
follows. An event that the table doesn't list is a defect of the caller: it is an error that names the state
and the event, and changes nothing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import Final


class State(Enum):
    """Where the preview is in its life."""

    DISABLED = "disabled"
    """No pipeline, no port, no CPU."""
    STARTING = "starting"
    """A pipeline is built or being built; no encoded frame yet."""
    RUNNING = "running"
    """Encoded frames leave."""
    STOPPING = "stopping"
    """The pipeline is being torn down because nobody wants it."""
    FAULTED = "faulted"
    """Wanted but not delivering; a retry is scheduled."""


class Event(Enum):
    """What can happen."""

    ENABLE = "enable"
    """It is wanted: for the first time, or once more by a new request."""
    DISABLE = "disable"
    """It is not wanted any more."""
    FIRST_FRAME = "first frame"
    """The first encoded frame reached the listener."""
    FAILURE = "failure"
    """Building, starting or running the pipeline failed."""
    RETRY = "retry"
    """The time until the next attempt is over."""
    STOPPED = "stopped"
    """The teardown that STOPPING waits for is done."""


_D, _S, _R, _X, _F = State.DISABLED, State.STARTING, State.RUNNING, State.STOPPING, State.FAULTED

TRANSITIONS: Final[Mapping[State, Mapping[Event, State]]] = MappingProxyType(
    {
        _D: {Event.ENABLE: _S, Event.DISABLE: _D},
        _S: {Event.ENABLE: _S, Event.DISABLE: _X, Event.FIRST_FRAME: _R, Event.FAILURE: _F},
        # Another profile is no transition: the same pipeline goes on with other figures.
        _R: {Event.ENABLE: _R, Event.DISABLE: _X, Event.FAILURE: _F},
        # Wanted again while stopping: the stop is finished first, then a new life begins. A frame that was
        # on its way, or a failure of what is being torn down anyway, means nothing any more.
        _X: {
            Event.ENABLE: _X,
            Event.DISABLE: _X,
            Event.FIRST_FRAME: _X,
            Event.FAILURE: _X,
            Event.STOPPED: _D,
        },
        _F: {Event.ENABLE: _S, Event.DISABLE: _D, Event.RETRY: _S},
    }
)

RETRY_DELAYS_S: Final = (1.0, 2.0, 4.0, 8.0, 16.0, 30.0)
"""Seconds before the first, second ... attempt after a fault; the last one repeats."""


class IllegalEventError(Exception):
    """An event that has no place in the current state: a defect of the caller."""

    def __init__(self, state: State, event: Event) -> None:
        super().__init__(f"'{event.value}' can't happen while {state.value}")
        self.state = state
        self.event = event


@dataclass(frozen=True, slots=True)
class Counters:
    """What happened since the process started.

    Args:
        starts: pipelines started.
        restarts: those of them that followed a fault.
        faults: times the state became FAULTED.
        fallbacks: times an encoder was passed over for the next one.
    """

    starts: int = 0
    restarts: int = 0
    faults: int = 0
    fallbacks: int = 0


class Lifecycle:
    """The current state, the retries since it last worked, and the counters."""

    def __init__(self, retry_delays_s: Sequence[float] = RETRY_DELAYS_S) -> None:
        self._state = State.DISABLED
        self._retry_delays_s = tuple(retry_delays_s)
        self._attempts_failed = 0
        self._counters = Counters()

    @property
    def state(self) -> State:
        """Where the preview is."""
        return self._state

    @property
    def counters(self) -> Counters:
        """What was counted so far."""
        return self._counters

    @property
    def retry_delay_s(self) -> float:
        """How long to wait, from the moment of the newest fault, before RETRY."""
        index = min(max(self._attempts_failed - 1, 0), len(self._retry_delays_s) - 1)
        return self._retry_delays_s[index]

    def handle(self, event: Event) -> State:
        """Moves on.

        Returns:
            The new state.

        Raises:
            IllegalEventError: the table has no such event in the current state; nothing was changed.
        """
        before = self._state
        after = TRANSITIONS[before].get(event)
        if after is None:
            raise IllegalEventError(before, event)
        self._count(before, event, after)
        self._state = after
        return after

    def note_fallback(self) -> None:
        """Counts an encoder that was passed over for the next one."""
        self._counters = _raised(self._counters, fallbacks=1)

    def note_steady(self) -> None:
        """The pipeline has run long enough to call its last fault over: delays begin at the first again."""
        self._attempts_failed = 0

    def _count(self, before: State, event: Event, after: State) -> None:
        if after is State.STARTING and before is not State.STARTING:
            self._counters = _raised(self._counters, starts=1, restarts=int(before is State.FAULTED))
        if after is State.FAULTED:
            self._attempts_failed += 1
            self._counters = _raised(self._counters, faults=1)
        if event is Event.DISABLE:
            self._attempts_failed = 0


def _raised(
    counters: Counters, *, starts: int = 0, restarts: int = 0, faults: int = 0, fallbacks: int = 0
) -> Counters:
    return Counters(
        counters.starts + starts,
        counters.restarts + restarts,
        counters.faults + faults,
        counters.fallbacks + fallbacks,
    )
