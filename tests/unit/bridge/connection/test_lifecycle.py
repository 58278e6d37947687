"""The one table of the connection's states."""

import pytest

from bridge.connection.connection_status import STATES
from bridge.connection.lifecycle import TRANSITIONS, Event, Phase, State, step


def test_the_table_is_total() -> None:
    assert {(state, event) for state in State for event in Event} == {
        (state, event) for state, row in TRANSITIONS.items() for event in row
    }
    assert set(STATES) == set(State)


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize(
    ("connection", "after"),
    [(Event.CONNECTED, State.CONNECTED), (Event.LOST, State.OFFLINE), (Event.REFUSED, State.REFUSED)],
)
def test_the_disk_comes_first_then_the_connection(state: State, connection: Event, after: State) -> None:
    phase = Phase(state, 1.0)
    assert step(phase, (Event.DISK_FAILED, connection), 2.0).state is State.FAULTED
    assert step(phase, (Event.DISK_WORKS, connection), 2.0).state is after


def test_the_time_is_that_of_the_change() -> None:
    phase = Phase(State.CONNECTED, 1.0)
    assert step(phase, (Event.DISK_WORKS, Event.CONNECTED), 5.0) == phase
    assert step(phase, (Event.DISK_WORKS, Event.LOST), 5.0) == Phase(State.OFFLINE, 5.0)
