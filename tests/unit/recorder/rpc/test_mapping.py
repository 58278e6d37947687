"""The mapping covers every value, and every one of the schema has its value."""

from collections.abc import Mapping
from enum import Enum
from typing import Any

import pytest

from common.errors import InvalidRequestError
from omniseer.gateway.v1 import recording_pb2 as pb
from recorder.rpc import mapping
from recorder.store.manifest import Copy, CopyState


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
