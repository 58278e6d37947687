"""Messages of robots that are not what their place in the hub requires are refused, each for a reason."""

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.reading import (
    LARGEST_STATE,
    NotReadableError,
    command_result,
    event_batch,
    robot_of,
    robot_state,
    stored_recording,
)
from omniseer.fleet.v1.command_pb2 import CommandResult
from omniseer.fleet.v1.event_pb2 import DroppedEvents, EventBatch, EventItem
from omniseer.fleet.v1.upload_pb2 import StoredRecording
from omniseer.gateway.v1.recording_pb2 import Recording
from tests.support.fleet_values import batch, event, healthy_state, subject_of, wrong_bytes

READERS: list[Callable[[str, bytes], Any]] = [robot_state, stored_recording, event_batch, command_result]


def test_what_is_right_is_read() -> None:
    state = healthy_state("r1")
    assert robot_state("r1", state.SerializeToString()) == state
    made = batch("r1", event(3), DroppedEvents(first_sequence=4, last_sequence=9), event(10))
    assert event_batch(subject_of(made), made.SerializeToString()) == made
    stored = StoredRecording(recording=Recording(id="a-1"))
    assert stored_recording("r1.a-1", stored.SerializeToString()) == stored
    result = CommandResult(robot="r1", command_id="c1")
    assert command_result("fleet.r1.res.c1", result.SerializeToString()) == result


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize("payload", list(wrong_bytes()))
def test_bytes_that_are_no_message(read: Callable[[str, bytes], Any], payload: bytes) -> None:
    with pytest.raises(NotReadableError, match="no message"):
        read("r1", payload)


@given(payload=st.binary(max_size=400), place=st.text(max_size=40))
def test_any_bytes_at_any_place_are_read_or_refused(payload: bytes, place: str) -> None:
    for read in READERS:
        with suppress(NotReadableError):
            read(place, payload)


def test_another_robots_name() -> None:
    with pytest.raises(NotReadableError, match="another robot"):
        robot_state("r2", healthy_state("r1").SerializeToString())
    made = batch("r1", event(3))
    for subject in ("fleet.r2.ev.g1.3", "fleet.r1.ev.g2.3", "fleet.r1.ev.g1.4", "fleet.r1.ev.g1", ""):
        with pytest.raises(NotReadableError, match="another robot or run"):
            event_batch(subject, made.SerializeToString())
    with pytest.raises(NotReadableError, match="another recording"):
        stored_recording("r1.b", StoredRecording(recording=Recording(id="a")).SerializeToString())
    with pytest.raises(NotReadableError, match="another command"):
        command_result("fleet.r1.res.c2", CommandResult(robot="r1", command_id="c1").SerializeToString())


def test_a_giant_is_refused_unread() -> None:
    state = healthy_state("r1")
    state.summary = "x" * LARGEST_STATE
    with pytest.raises(NotReadableError, match="larger than 64 KiB"):
        robot_state("r1", state.SerializeToString())


@pytest.mark.parametrize(
    "items",
    [
        [event(3), event(5)],
        [event(3), event(3)],
        [DroppedEvents(first_sequence=3, last_sequence=2)],
        [event(3), DroppedEvents(first_sequence=5, last_sequence=6)],
    ],
    ids=["a hole", "twice", "a gap that ends before it begins", "a hole before a gap"],
)
def test_items_that_do_not_follow_one_another(items: list[Any]) -> None:
    made = batch("r1", *items)
    with pytest.raises(NotReadableError, match="follow one another"):
        event_batch(subject_of(made), made.SerializeToString())


def test_a_batch_that_announces_more_than_it_has() -> None:
    made = batch("r1", event(3))
    made.last_sequence = 4
    with pytest.raises(NotReadableError, match="announces"):
        event_batch(subject_of(made), made.SerializeToString())
    empty = EventBatch(robot="r1", run_id="g1", first_sequence=1)
    with pytest.raises(NotReadableError, match="announces"):
        event_batch(subject_of(empty), empty.SerializeToString())
    empty.items.append(EventItem())
    with pytest.raises(NotReadableError, match="neither"):
        event_batch(subject_of(empty), empty.SerializeToString())


def test_the_robot_of_a_subject() -> None:
    assert robot_of("fleet.r1.ev.g1.3") == "r1"
    assert robot_of("fleet") == ""
