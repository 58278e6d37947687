"""The fleet's messages as values: total over the schema, and safe for a terminal."""

from dataclasses import fields
from enum import Enum

import pytest
from google.protobuf.descriptor import EnumDescriptor

from console.fleet import values
from console.fleet.wire import (
    answer_of,
    command_bytes,
    items_of,
    recording_of,
    snapshot_command,
    state_of,
    upload_command,
)
from omniseer.fleet.v1 import command_pb2, event_pb2, state_pb2
from omniseer.fleet.v1.upload_pb2 import StoredRecording
from tests.support.control_characters import CONTROL_CHARACTERS, change_texts
from tests.support.filled import fill
from tests.support.fleet_values import batch, event, healthy_state, subject_of, wrong_bytes


@pytest.mark.parametrize(
    ("members", "wire"),
    [
        (values.DropReason, event_pb2.DropReason.DESCRIPTOR),
        (values.CommandOutcome, command_pb2.CommandOutcome.DESCRIPTOR),
    ],
)
def test_every_value_of_the_schema_has_a_member(members: type[Enum], wire: EnumDescriptor) -> None:
    names = {value.name for value in wire.values if value.number}
    assert all(any(name.endswith(f"_{each.name}") for each in members) for name in names)
    assert len(members) == len(wire.values)


def test_every_field_of_a_state_is_a_value() -> None:
    # The robot is the key that it was read from.
    sent = {field.name for field in state_pb2.RobotState.DESCRIPTOR.fields} - {"robot"}
    assert {field.name for field in fields(values.RobotState)} == sent


def test_no_text_of_a_robot_has_control_characters() -> None:
    message = state_pb2.RobotState()
    fill(message)
    change_texts(message, lambda _: CONTROL_CHARACTERS)
    message.robot = "a"
    state = state_of("a", message.SerializeToString())
    assert isinstance(state, values.RobotState)
    assert not set(CONTROL_CHARACTERS) & set(f"{state.summary}{state.mode}{state.faults}{state.uploads}")


def test_events_and_gaps_in_their_order() -> None:
    gap = event_pb2.DroppedEvents(
        reason=event_pb2.DROP_REASON_OUTBOX_FULL,
        first_sequence=4,
        last_sequence=9,
        earlier_run_incomplete=True,
    )
    made = batch("a", event(3, message="lidar \x1b[2J"), gap, event(10))
    first, dropped, last = items_of(subject_of(made), made.SerializeToString(), 5)
    assert isinstance(first, values.RobotEvent)
    assert (first.robot, first.received_unix_ms, first.event.message) == ("a", 5, "lidar  [2J")
    assert isinstance(dropped, values.EventsDropped)
    assert (dropped.reason, dropped.count) == (values.DropReason.OUTBOX_FULL, 6)
    assert dropped.earlier_run_incomplete
    assert isinstance(last, values.RobotEvent)
    assert last.event.position.sequence == 10


@pytest.mark.parametrize("payload", list(wrong_bytes()))
def test_what_is_unreadable_is_a_value(payload: bytes) -> None:
    (item,) = items_of("fleet.a.ev.g1.3", payload, 0)
    for found in (
        item,
        state_of("a", payload),
        recording_of("a.b", payload),
        answer_of("fleet.a.res.c", payload),
    ):
        assert isinstance(found, values.Unreadable)
        assert found.robot == "a"


def test_a_hostile_subject_is_text() -> None:
    (item,) = items_of("fleet.\x1b]0;x\x07.ev.g1.3", b"\xff", 0)
    assert isinstance(item, values.Unreadable)
    assert item.robot.isprintable()


def test_a_stored_recording() -> None:
    message = StoredRecording()
    fill(message)
    message.recording.id = "r-1"
    found = recording_of("a.r-1", message.SerializeToString())
    assert not isinstance(found, values.Unreadable)
    recording, files, _ = found
    assert recording.id == "r-1"
    assert [file.name for file in files] == ["first"]


def test_a_command_has_its_action_and_its_end() -> None:
    for action, name in (
        (snapshot_command(pre_s=5, post_s=None, label="x"), "snapshot"),
        (upload_command("r-1"), "upload"),
    ):
        data = command_bytes(action, "a", command_id="c1", issued_by="anna", now_unix_ms=7, expires_s=60)
        command = command_pb2.Command.FromString(data)
        assert command.WhichOneof("action") == name
        assert (command.robot, command.command_id, command.issued_by) == ("a", "c1", "anna")
        assert (command.issued_unix_ms, command.expires_after_s) == (7, 60)
        assert not command.snapshot.HasField("post_s")


def test_a_healthy_state_is_read_whole() -> None:
    state = state_of("a", healthy_state("a").SerializeToString())
    assert isinstance(state, values.RobotState)
    assert (state.battery_percent, state.charging) == (78, None)
