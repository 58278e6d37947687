"""Every kind of event has its payload in the contract, and every field of it is set."""

from typing import get_args

import pytest

from gateway.rpc.mapping.events import event_message, gap_message, position_from, position_message
from gateway.status.cloud import CloudState, RecordingCopy, RecordingCopyState
from gateway.status.event import (
    ClientJoined,
    ClientLeft,
    CloudChanged,
    ControlAction,
    ControlResult,
    Detail,
    EncoderFallback,
    Event,
    FaultCleared,
    FaultRaised,
    LoggedEvent,
    ModeChanged,
    PreviewChanged,
    RecordingChanged,
    RecordingCopyChanged,
)
from gateway.status.event_log import Gap, GapReason, Position
from gateway.status.fault import Condition, Fault, Severity
from gateway.status.preview import PreviewState, Profile
from gateway.status.recording import (
    RecordingChange,
    RecordingKind,
    RecordingState,
    RecordingStopReason,
)
from omniseer.gateway.v1.event_pb2 import Event as EventMessage

FAULT = Fault(Condition("odometry.stale", Severity.ERROR, "odometry", "m", "r"), 1.0, 2.0, 3.0, 4)
DETAILS: list[Detail] = [
    FaultRaised(FAULT),
    FaultCleared(FAULT),
    PreviewChanged(PreviewState.FAULTED, Profile.LOW_BW, "no camera", "rear"),
    EncoderFallback("x264", "mpp", "it hangs"),
    ClientJoined("10.0.0.1:1", "alice"),
    ClientLeft("10.0.0.1:1", "alice"),
    ControlAction("alice", "10.0.0.1:1", "SetPreviewMode", "enabled: true", ControlResult.REFUSED, "no"),
    ModeChanged("exploring"),
    RecordingChanged(
        RecordingChange.ENDED,
        "a",
        "lap",
        RecordingKind.MANUAL,
        RecordingState.COMPLETE,
        RecordingStopReason.DISK,
        7,
        3,
    ),
    CloudChanged(CloudState.REFUSED, "it was revoked"),
    RecordingCopyChanged("a", "lap", RecordingCopy(RecordingCopyState.FAILED, "no network", 7)),
]


def test_every_kind_of_event_is_tried() -> None:
    assert {type(detail) for detail in DETAILS} == set(get_args(Detail))


@pytest.mark.parametrize("detail", DETAILS, ids=lambda detail: type(detail).__name__)
def test_an_event_sets_every_field_of_its_payload(detail: Detail) -> None:
    event = LoggedEvent(7, 5.5, 1_700_000_000_000, Event(Severity.ERROR, "odometry", "it happened", detail))
    message = event_message(event, "run")
    assert (message.run_id, message.sequence, message.monotonic_ns) == ("run", 7, 5_500_000_000)
    assert message.wall_clock_unix_ms == 1_700_000_000_000
    assert (message.component, message.message) == ("odometry", "it happened")
    payload = getattr(message, str(message.WhichOneof("payload")))
    unset = {field.name for field in payload.DESCRIPTOR.fields} - {
        field.name for field, _ in payload.ListFields()
    }
    assert not unset


def test_every_payload_of_the_schema_comes_from_somewhere() -> None:
    sent = {
        event_message(LoggedEvent(1, 1.0, 1, Event(Severity.INFO, "c", "m", each)), "run").WhichOneof(
            "payload"
        )
        for each in DETAILS
    }
    assert sent == {field.name for field in EventMessage.DESCRIPTOR.oneofs_by_name["payload"].fields}


def test_a_gap_and_a_position_are_sent_whole() -> None:
    gap = gap_message(Gap(GapReason.NEW_RUN, 3, Position("run", 12)))
    assert (gap.missed_count, gap.position.run_id, gap.position.sequence) == (3, "run", 12)
    assert position_from(position_message(Position("run", 12))) == Position("run", 12)
