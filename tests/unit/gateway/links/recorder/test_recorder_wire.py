"""The recorder's schema as values: every state is known, an unknown one breaks the connection."""

import grpc
import pytest
from google.rpc.error_details_pb2 import ErrorInfo
from google.rpc.status_pb2 import Status

from common.errors import (
    ConflictError,
    DamagedError,
    DefectError,
    DomainError,
    InvalidRequestError,
    NotFoundError,
    PreconditionError,
    RecorderUnreachableError,
    TooMuchError,
)
from common.reasons import Reason
from common.refusal import DOMAIN
from gateway.links.recorder import wire
from gateway.links.recorder.refusals import REFUSALS
from gateway.links.watch import LinkLostError
from gateway.status.recording import (
    RecorderState,
    RecordingKind,
    RecordingState,
    RecordingStopReason,
)
from omniseer.gateway.v1 import recording_pb2 as pb
from omniseer.recorder.v1.recorder_service_pb2 import WatchStateResponse

CODE = grpc.StatusCode


def test_every_state_of_the_schema_is_known() -> None:
    assert set(wire.STATES.values()) == set(RecorderState)
    assert set(wire.STATES) == set(pb.RecorderState.values()) - {0}
    assert set(wire.KINDS.values()) == set(RecordingKind)
    assert set(wire.RECORDING_STATES.values()) == set(RecordingState)
    assert set(wire.STOP_REASONS.values()) == set(RecordingStopReason)


@pytest.mark.parametrize("number", [0, pb.RECORDER_STATE_UNREACHABLE, 42])
def test_a_state_that_it_can_not_report_breaks_the_connection(number: int) -> None:
    message = WatchStateResponse()
    message.status.state = number  # type: ignore[assignment]  # the point of it
    with pytest.raises(LinkLostError, match=f"unknown state number {number}"):
        wire.report_from(message)


def test_a_report_arrives_whole() -> None:
    message = WatchStateResponse(
        instance_id="a",
        messages_lost=0,
        messages_dropped=3,
        disk_short=True,
        uncounted_gaps=5,
        ring_failures=7,
    )
    message.status.state, message.status.room_s = pb.RECORDER_STATE_RECORDING, 0
    message.status.presets.add(name="driving", in_ring=True)
    message.newest.id, message.newest.state = "b", pb.RECORDING_STATE_RECORDING
    message.ended.add(id="c", state=pb.RECORDING_STATE_COMPLETE, kind=99)
    report = wire.report_from(message)
    assert (report.instance_id, report.messages_lost, report.missing, report.disk_short) == ("a", 0, 3, True)
    assert (report.status.state, report.status.room_s) == (RecorderState.RECORDING, 0)
    assert (report.uncounted_gaps, report.ring_failures) == (5, 7)
    assert report.status.messages_lost is None
    assert [each.name for each in report.status.presets] == ["driving"]
    assert [(each.id, each.kind) for each in report.ended] == [("c", None)]


def refusal(code: grpc.StatusCode, reason: str = "", domain: str = DOMAIN) -> DomainError:
    details = Status(code=code.value[0])
    details.details.add().Pack(ErrorInfo(reason=reason, domain=domain))
    metadata = grpc.aio.Metadata(("grpc-status-details-bin", details.SerializeToString()))
    return REFUSALS.refused(grpc.aio.AioRpcError(code, grpc.aio.Metadata(), metadata, "its own words"))


@pytest.mark.parametrize(
    ("code", "reason", "kind"),
    [
        (CODE.NOT_FOUND, Reason.RECORDING_NOT_FOUND, NotFoundError),
        (CODE.FAILED_PRECONDITION, Reason.RECORDING_RUNS, PreconditionError),
        (CODE.ABORTED, Reason.RECORDING_DELETED, ConflictError),
        (CODE.RESOURCE_EXHAUSTED, Reason.TOO_MANY_SNAPSHOTS, TooMuchError),
        (CODE.INVALID_ARGUMENT, Reason.INVALID_REQUEST, InvalidRequestError),
        (CODE.DATA_LOSS, Reason.RECORDING_DAMAGED, DamagedError),
    ],
)
def test_a_refusal_keeps_its_words_and_its_reason(
    code: grpc.StatusCode, reason: Reason, kind: type[DomainError]
) -> None:
    error = refusal(code, reason)
    assert (type(error), error.reason, str(error)) == (kind, reason, "its own words")


def test_a_reason_that_is_not_known_is_replaced_by_the_general_one() -> None:
    assert refusal(CODE.FAILED_PRECONDITION, "OF_A_NEWER_RECORDER").reason is Reason.RECORDER_NOT_READY
    foreign = refusal(CODE.NOT_FOUND, Reason.LEASE_HELD, "somewhere.else")
    assert foreign.reason is Reason.RECORDING_NOT_FOUND


def test_one_that_is_gone_and_one_that_fails() -> None:
    for code in (CODE.UNAVAILABLE, CODE.DEADLINE_EXCEEDED, CODE.CANCELLED):
        assert isinstance(refusal(code), RecorderUnreachableError)
    for code in (CODE.INTERNAL, CODE.UNKNOWN, CODE.UNIMPLEMENTED):
        assert isinstance(refusal(code), DefectError)
        assert "its own words" not in str(refusal(code)), "callers get no internals of it"
