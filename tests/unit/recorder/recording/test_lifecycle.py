"""Every transition, driven directly."""

import pytest

from recorder.recording.lifecycle import Event, IllegalEventError, Phase, State, step

# Written out once more, from the design: the table must not be its own judge.
EXPECTED = {
    (State.RECOVERING, Event.RECOVERED): State.IDLE,
    (State.RECOVERING, Event.FAILURE): State.FAULTED,
    (State.IDLE, Event.START): State.STARTING,
    (State.IDLE, Event.FAILURE): State.FAULTED,
    (State.STARTING, Event.OPENED): State.RECORDING,
    (State.STARTING, Event.FAILURE): State.FAULTED,
    (State.RECORDING, Event.STOP): State.FINALISING,
    (State.RECORDING, Event.FAILURE): State.FAULTED,
    (State.FINALISING, Event.STOP): State.FINALISING,
    (State.FINALISING, Event.CLOSED): State.IDLE,
    (State.FINALISING, Event.FAILURE): State.FAULTED,
    (State.FAULTED, Event.FAILURE): State.FAULTED,
    (State.FAULTED, Event.CLEARED): State.IDLE,
}


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize("event", Event)
def test_every_pair_of_state_and_event(state: State, event: Event) -> None:
    before = Phase(state, since_s=1.0)
    if (state, event) not in EXPECTED:
        with pytest.raises(IllegalEventError, match=f"'{event.value}' can't happen while {state.value}"):
            step(before, event, 5.0)
        return
    after = step(before, event, 5.0)
    assert after.state is EXPECTED[state, event]
    assert after.since_s == (1.0 if after.state is state else 5.0)


def test_a_recording_that_is_stopped_in_order_ends_where_the_next_can_start() -> None:
    phase = Phase(State.RECOVERING, 0.0)
    for event in (Event.RECOVERED, Event.START, Event.OPENED, Event.STOP, Event.CLOSED, Event.START):
        phase = step(phase, event, phase.since_s + 1)
    assert phase == Phase(State.STARTING, 6.0)
