"""Lifecycle of the preview: one table of transitions, retry backoff, counters.

Pure: knows no pipeline, encoder or clock. The supervisor reports events, the table gives the next state. An
event that the table does not list for the current state is a defect of the caller: it raises an error that
names both and changes nothing.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from types import MappingProxyType
from typing import Final

from common.backoff import Backoff


class State(Enum):
    """State of the preview."""

    DISABLED = "disabled"
    """No pipeline, no bound port, no CPU time; for viewers: no bound port."""
    STARTING = "starting"
    """A pipeline is being built or started; no encoded frame yet."""
    RUNNING = "running"
    """Encoded frames reach the listener."""
    STOPPING = "stopping"
    """The pipeline is being torn down because the preview was disabled."""
    FAULTED = "faulted"
    """Enabled but not delivering; a retry is scheduled."""


class Event(Enum):
    """Event that may change the state."""

    ENABLE = "enable"
    """A pipeline is wanted, or wanted again by a new request."""
    DISABLE = "disable"
    """No pipeline is wanted any more."""
    FIRST_FRAME = "first frame"
    """The first encoded frame reached the listener."""
    FAILURE = "failure"
    """Building, starting or running the pipeline failed."""
    RETRY = "retry"
    """The retry delay has expired."""
    STOPPED = "stopped"
    """The teardown that STOPPING waits for has finished."""


class Reason(Enum):
    """Reason for which a pipeline is to run. It runs while there is at least one."""

    VIEWERS = "viewers"
    """The preview is enabled: viewers may connect to the listener."""
    RECORDING = "recording"
    """A recorder is connected to the video tap. It needs no listener."""


class Listening(Enum):
    """Whether viewers can connect to a running pipeline."""

    NO = "no"
    YES = "yes"
    FAILED = "failed"
    """Its listener has failed, while the pipeline goes on; a retry is scheduled."""


_D, _S, _R, _X, _F = State.DISABLED, State.STARTING, State.RUNNING, State.STOPPING, State.FAULTED

TRANSITIONS: Final[Mapping[State, Mapping[Event, State]]] = MappingProxyType(
    {
        _D: {Event.ENABLE: _S, Event.DISABLE: _D},
        _S: {Event.ENABLE: _S, Event.DISABLE: _X, Event.FIRST_FRAME: _R, Event.FAILURE: _F},
        # Switching the profile is no transition: the same pipeline goes on with other parameters.
        _R: {Event.ENABLE: _R, Event.DISABLE: _X, Event.FAILURE: _F},
        # Enabled again while stopping: the teardown is finished before the next start. A first frame or a
        # failure of the pipeline being torn down has no effect.
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

_FOR_VIEWERS: Final[Mapping[Listening, State]] = MappingProxyType(
    {Listening.NO: _S, Listening.YES: _R, Listening.FAILED: _F}
)


def state_for_viewers(state: State, *, enabled: bool, listening: Listening) -> State:
    """Returns the state of the preview as operators see it: a recording alone is none of theirs.

    | pipeline | enabled | listening | for viewers |
    |---|---|---|---|
    | RUNNING | yes | yes, no, failed | RUNNING, STARTING, FAULTED |
    | any other | yes | any | that of the pipeline |
    | FAULTED | no | yes | FAULTED, until it is torn down |
    | any other | no | yes | STOPPING, until the listener is closed |
    | any | no | no, failed | DISABLED |

    Args:
        state: of the pipeline.
        enabled: whether the preview is to run for viewers.
        listening: whether the pipeline has a listener.
    """
    if enabled:
        return _FOR_VIEWERS[listening] if state is State.RUNNING else state
    if listening is not Listening.YES or state is State.DISABLED:
        return State.DISABLED
    return State.FAULTED if state is State.FAULTED else State.STOPPING


FIRST_RETRY_S: Final = 1.0
LONGEST_RETRY_S: Final = 30.0
STEADY_AFTER_S: Final = 15.0
"""A pipeline, or a listener, that ran this long has recovered: its backoff starts again."""


class IllegalEventError(Exception):
    """Event without a transition from the current state."""

    def __init__(self, state: State, event: Event) -> None:
        super().__init__(f"'{event.value}' can't happen while {state.value}")
        self.state = state
        self.event = event


@dataclass(frozen=True, slots=True)
class Counters:
    """Counts since the process started.

    Args:
        starts: pipelines started.
        restarts: pipelines started after a fault; included in `starts`.
        faults: transitions to FAULTED.
        fallbacks: encoders replaced by the next one after a failure.
        viewers_refused: connections refused because of srt.max_viewers.
    """

    starts: int = 0
    restarts: int = 0
    faults: int = 0
    fallbacks: int = 0
    viewers_refused: int = 0


class Lifecycle:
    """Current state, retry backoff and counters.

    Attributes:
        retry_delay_s: seconds from the newest fault to its retry.
    """

    def __init__(self) -> None:
        self.state = State.DISABLED
        self.counters = Counters()
        self.retry_delay_s = FIRST_RETRY_S
        self._backoff = Backoff(FIRST_RETRY_S, LONGEST_RETRY_S)

    def handle(self, event: Event) -> State:
        """Applies an event and returns the new state.

        Raises:
            IllegalEventError: no transition for this event; nothing was changed.
        """
        before = self.state
        after = TRANSITIONS[before].get(event)
        if after is None:
            raise IllegalEventError(before, event)
        self._count(before, event, after)
        self.state = after
        return after

    def count(self, *, fallbacks: int = 0, viewers_refused: int = 0) -> None:
        """Counts what is no transition: encoders replaced by the next one, refused viewers."""
        counters = self.counters
        self.counters = replace(
            counters,
            fallbacks=counters.fallbacks + fallbacks,
            viewers_refused=counters.viewers_refused + viewers_refused,
        )

    def reset_backoff(self) -> None:
        """Starts the backoff again: the pipeline has run steadily since its last fault."""
        self._backoff.reset()

    def _count(self, before: State, event: Event, after: State) -> None:
        count = self.counters
        if after is State.STARTING and before is not State.STARTING:
            restarts = count.restarts + (before is State.FAULTED)
            self.counters = replace(count, starts=count.starts + 1, restarts=restarts)
        if after is State.FAULTED:
            self.retry_delay_s = self._backoff.next_s()
            self.counters = replace(count, faults=count.faults + 1)
        if event is Event.DISABLE:
            self.reset_backoff()
