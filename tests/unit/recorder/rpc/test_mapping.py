"""The mapping covers every value, and every one of the schema has its value."""

from collections.abc import Mapping
from enum import Enum
from typing import TYPE_CHECKING, Any, cast

import pytest

from common.errors import InvalidRequestError
from omniseer.gateway.v1 import recording_pb2 as pb
from recorder.recording.requests import Live
from recorder.rpc import mapping
from recorder.store.manifest import Copy, CopyState, Kind, Manifest, RecordingState

if TYPE_CHECKING:
    from recorder.recording.status_reader import StatusReader


@pytest.mark.parametrize(
    ("table", "message", "unmapped"),
    [
        (mapping.STATES, pb.RecorderState, {0, pb.RECORDER_STATE_UNREACHABLE}),
        (mapping.KINDS, pb.RecordingKind, {0}),
        (mapping.RECORDING_STATES, pb.RecordingState, {0}),
        (mapping.STOP_REASONS, pb.RecordingStopReason, {0}),
        (mapping.GAP_CAUSES, pb.RecordingGapCause, {0}),
        (mapping.COPY_STATES, pb.RecordingCopyState, set()),
    ],
)
def test_tables_are_total(table: Mapping[Enum, int], message: Any, unmapped: set[int]) -> None:
    assert set(table) == set(type(next(iter(table))))
    assert set(table.values()) == set(message.values()) - unmapped


def test_a_copy_comes_back_as_it_was() -> None:
    for state in CopyState:
        message = pb.RecordingCopy(state=mapping.COPY_STATES[state], reason="why", bytes_done=7)
        assert mapping.copy(message) == Copy(state=state, reason="why", bytes_done=7)
    with pytest.raises(InvalidRequestError, match="99"):
        mapping.copy(pb.RecordingCopy(state=99))  # type: ignore[arg-type]  # of a later version


class Still:
    """A recorder that writes nothing; counts how often it is asked how far a recording has come."""

    def __init__(self) -> None:
        self.asked = 0

    def live(self, manifest: Manifest) -> Live:
        self.asked += 1
        return Live(0, manifest.messages, manifest.video_frames, manifest.losses)


def test_the_message_of_a_recording_that_has_ended_is_made_once() -> None:
    """It is sent twice a second, and a recording of a week has 10000 files."""
    made = [
        Manifest(id=f"20260101T00000{number}Z-abcdef", kind=Kind.MANUAL, state=RecordingState.COMPLETE)
        for number in range(2)
    ]
    recorder, messages = Still(), mapping.RecordingMessages()
    reader = cast("StatusReader", recorder)
    first = [messages.of(reader, each) for each in made]
    assert [each.id for each in first] == [each.id for each in made]
    assert [messages.of(reader, each) for each in made] == first
    assert recorder.asked == 2
    assert messages.of(reader, made[0].model_copy(update={"pinned": True})).pinned
    assert recorder.asked == 3


def test_the_message_of_a_recording_that_runs_is_always_made_anew() -> None:
    recorder, messages = Still(), mapping.RecordingMessages()
    runs = Manifest(id="20260101T000000Z-abcdef", kind=Kind.MANUAL, state=RecordingState.RECORDING)
    for _ in range(2):
        messages.of(cast("StatusReader", recorder), runs)
    assert recorder.asked == 2


def test_messages_that_are_kept_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mapping, "MOST_MADE", 2)
    recorder, messages = Still(), mapping.RecordingMessages()
    for number in (0, 1, 2, 2, 0):
        recording_id = f"20260101T00000{number}Z-abcdef"
        made = Manifest(id=recording_id, kind=Kind.MANUAL, state=RecordingState.COMPLETE)
        messages.of(cast("StatusReader", recorder), made)
    assert len(messages._made) == 2
