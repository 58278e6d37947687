"""Every transition, driven directly."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from preview.state.lifecycle import (
    TRANSITIONS,
    Event,
    IllegalEventError,
    Lifecycle,
    Listening,
    State,
    state_for_viewers,
)

# How to get to each state from the beginning.
PATHS = {
    State.DISABLED: [],
    State.STARTING: [Event.ENABLE],
    State.RUNNING: [Event.ENABLE, Event.FIRST_FRAME],
    State.STOPPING: [Event.ENABLE, Event.DISABLE],
    State.FAULTED: [Event.ENABLE, Event.FAILURE],
}
# Written out once more, from the design: the table must not be its own judge.
EXPECTED = {
    (State.DISABLED, Event.ENABLE): State.STARTING,
    (State.DISABLED, Event.DISABLE): State.DISABLED,
    (State.STARTING, Event.ENABLE): State.STARTING,
    (State.STARTING, Event.DISABLE): State.STOPPING,
    (State.STARTING, Event.FIRST_FRAME): State.RUNNING,
    (State.STARTING, Event.FAILURE): State.FAULTED,
    (State.RUNNING, Event.ENABLE): State.RUNNING,
    (State.RUNNING, Event.DISABLE): State.STOPPING,
    (State.RUNNING, Event.FAILURE): State.FAULTED,
    (State.STOPPING, Event.ENABLE): State.STOPPING,
    (State.STOPPING, Event.DISABLE): State.STOPPING,
    (State.STOPPING, Event.FIRST_FRAME): State.STOPPING,
    (State.STOPPING, Event.FAILURE): State.STOPPING,
    (State.STOPPING, Event.STOPPED): State.DISABLED,
    (State.FAULTED, Event.ENABLE): State.STARTING,
    (State.FAULTED, Event.DISABLE): State.DISABLED,
    (State.FAULTED, Event.RETRY): State.STARTING,
}


def in_state(state: State) -> Lifecycle:
    lifecycle = Lifecycle()
    for event in PATHS[state]:
        lifecycle.handle(event)
    assert lifecycle.state is state
    return lifecycle


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize("event", Event)
def test_every_pair_of_state_and_event(state: State, event: Event) -> None:
    lifecycle = in_state(state)
    before = lifecycle.counters
    if (state, event) in EXPECTED:
        assert lifecycle.handle(event) is EXPECTED[state, event]
        return
    with pytest.raises(IllegalEventError, match=f"'{event.value}' can't happen while {state.value}"):
        lifecycle.handle(event)
    assert lifecycle.state is state
    assert lifecycle.counters == before


def test_delays_grow_and_stay_at_the_longest() -> None:
    lifecycle = Lifecycle()
    lifecycle.handle(Event.ENABLE)
    delays = []
    for _ in range(8):
        lifecycle.handle(Event.FAILURE)
        delays.append(lifecycle.retry_delay_s)
        lifecycle.handle(Event.RETRY)
    assert delays == [1, 2, 4, 8, 16, 30, 30, 30]


@pytest.mark.parametrize("calming", ["steady", "disable"])
def test_delays_begin_again(calming: str) -> None:
    lifecycle = in_state(State.FAULTED)
    for _ in range(4):
        lifecycle.handle(Event.RETRY)
        lifecycle.handle(Event.FAILURE)
    if calming == "steady":
        lifecycle.handle(Event.RETRY)
        lifecycle.handle(Event.FIRST_FRAME)
        lifecycle.reset_backoff()
    else:
        lifecycle.handle(Event.DISABLE)
        lifecycle.handle(Event.ENABLE)
    lifecycle.handle(Event.FAILURE)
    assert lifecycle.retry_delay_s == 1


def test_a_first_frame_alone_does_not_shorten_the_delay() -> None:
    """An encoder that fails after every first frame must not be tried every second forever."""
    lifecycle = in_state(State.FAULTED)
    lifecycle.handle(Event.RETRY)
    lifecycle.handle(Event.FIRST_FRAME)
    lifecycle.handle(Event.FAILURE)
    assert lifecycle.retry_delay_s == 2


@pytest.mark.parametrize("again", [Event.RETRY, Event.ENABLE])
def test_a_start_after_a_fault_is_a_restart_and_another_request_meanwhile_is_no_start(again: Event) -> None:
    lifecycle = in_state(State.FAULTED)
    before = lifecycle.counters
    lifecycle.handle(again)
    lifecycle.handle(Event.ENABLE)
    assert lifecycle.state is State.STARTING
    assert lifecycle.counters == replace(before, starts=before.starts + 1, restarts=before.restarts + 1)


def test_counters() -> None:
    lifecycle = in_state(State.RUNNING)
    lifecycle.handle(Event.FAILURE)
    lifecycle.count(fallbacks=1)
    lifecycle.handle(Event.RETRY)
    lifecycle.handle(Event.FIRST_FRAME)
    lifecycle.handle(Event.DISABLE)
    lifecycle.handle(Event.STOPPED)
    lifecycle.handle(Event.ENABLE)
    counters = lifecycle.counters
    assert (counters.starts, counters.restarts, counters.faults, counters.fallbacks) == (3, 1, 1, 1)


@given(st.lists(st.sampled_from(Event), max_size=60))
def test_whatever_happens_the_books_balance(events: list[Event]) -> None:
    lifecycle = Lifecycle()
    for event in events:
        legal = event in TRANSITIONS[lifecycle.state]
        before = lifecycle.state
        try:
            lifecycle.handle(event)
        except IllegalEventError:
            assert not legal
            assert lifecycle.state is before
        else:
            assert legal
        counters = lifecycle.counters
        assert counters.restarts <= counters.faults
        assert counters.restarts < max(counters.starts, 1)
        assert counters.faults <= counters.starts
        assert lifecycle.retry_delay_s in (1, 2, 4, 8, 16, 30)
    # From wherever it is, it can be switched off.
    lifecycle.handle(Event.DISABLE)
    if lifecycle.state is State.STOPPING:
        lifecycle.handle(Event.STOPPED)
    assert lifecycle.state is State.DISABLED


# By whether the preview is enabled, and whether there is a listener: what operators see of each state of the
# pipeline, in the order DISABLED, STARTING, RUNNING, STOPPING, FAULTED.
_D, _S, _R, _X, _F = State.DISABLED, State.STARTING, State.RUNNING, State.STOPPING, State.FAULTED
FOR_VIEWERS = {
    (True, Listening.YES): [_D, _S, _R, _X, _F],
    (True, Listening.NO): [_D, _S, _S, _X, _F],
    (True, Listening.FAILED): [_D, _S, _F, _X, _F],
    (False, Listening.YES): [_D, _X, _X, _X, _F],
    (False, Listening.NO): [_D, _D, _D, _D, _D],
    (False, Listening.FAILED): [_D, _D, _D, _D, _D],
}


@pytest.mark.parametrize(("case", "expected"), FOR_VIEWERS.items(), ids=str)
def test_what_operators_see_of_a_pipeline(case: tuple[bool, Listening], expected: list[State]) -> None:
    enabled, listening = case
    seen = [state_for_viewers(state, enabled=enabled, listening=listening) for state in (_D, _S, _R, _X, _F)]
    assert seen == expected


def test_every_case_of_what_operators_see_is_written_out() -> None:
    assert set(FOR_VIEWERS) == {(enabled, listening) for enabled in (True, False) for listening in Listening}
