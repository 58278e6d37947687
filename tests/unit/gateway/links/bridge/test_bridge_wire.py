"""The bridge's schema as values; whatever the hub has it pass on stays short and printable."""

import grpc
import pytest

from common.errors import (
    BridgeUnreachableError,
    DefectError,
    DomainError,
    InvalidRequestError,
    NotFoundError,
    PreconditionError,
    TooMuchError,
)
from gateway.links.bridge import wire
from gateway.links.bridge.refusals import REFUSALS
from gateway.links.bridge.requests import Outcome
from gateway.links.watch import LinkLostError
from gateway.status.cloud import CloudState, HubAction, NotTaken, RecordingCopyState, Retries
from omniseer.bridge.v1 import bridge_service_pb2 as pb
from omniseer.gateway.v1 import cloud_pb2, recording_pb2

CODE = grpc.StatusCode
NOW_S = 1000.0


def message() -> pb.WatchStateResponse:
    made = pb.WatchStateResponse(instance_id="a")
    made.status.state = cloud_pb2.CLOUD_STATE_CONNECTED
    return made


def test_every_state_and_action_of_the_schema_is_known() -> None:
    assert set(wire.STATES.values()) == set(CloudState)
    assert set(wire.STATES) == set(cloud_pb2.CloudState.values()) - {0}
    assert set(wire.COPY_STATES.values()) == set(RecordingCopyState)
    assert set(wire.COPY_STATES) == set(recording_pb2.RecordingCopyState.values())
    assert set(wire.OUTCOMES.values()) == set(Outcome)
    assert set(wire.OUTCOMES) == set(pb.RequestOutcome.values()) - {0}
    (action,) = pb.HubRequest.DESCRIPTOR.oneofs
    assert {field.name for field in action.fields} == {each.value for each in HubAction}


@pytest.mark.parametrize("number", [0, cloud_pb2.CLOUD_STATE_UNREACHABLE, 42, -1])
def test_a_state_that_it_can_not_report_breaks_the_connection(number: int) -> None:
    wrong = message()
    wrong.status.state = number  # type: ignore[assignment]  # the point of it
    with pytest.raises(LinkLostError, match=f"unknown state number {number}"):
        wire.report_from(wrong, NOW_S)


def test_a_report_arrives_whole() -> None:
    made = message()
    made.status.robot, made.status.fleet, made.status.events_sent = "lab-1", "lab", 7
    made.copies.add(recording_id="a").copy.state = recording_pb2.RECORDING_COPY_STATE_FAILED
    made.copies.add(recording_id="b", state_age_ms=1500)
    upload = made.requests.add(request_id="u", issued_by="anna", remaining_ms=5000)
    upload.upload.recording_id = "a"
    snapshot = made.requests.add(request_id="s", remaining_ms=1)
    snapshot.snapshot.pre_s, snapshot.snapshot.label = 0, "here"
    made.not_taken.unreadable, made.not_taken.dropped = 1, 2
    made.not_taken.strays, made.not_taken.denied = 3, 4
    made.retries.hub, made.retries.state, made.retries.disk = 5, 6, 7
    made.retries.gateway, made.retries.upload = 8, 9
    report = wire.report_from(made, NOW_S)
    assert (report.status.robot, report.status.events_sent) == ("lab-1", 7)
    assert (report.status.last_sent_age_ms, report.status.uploading) == (None, None)
    assert [(each.recording_id, each.copy.state, each.since_s) for each in report.copies] == [
        ("a", RecordingCopyState.FAILED, None),
        ("b", RecordingCopyState.UNSPECIFIED, NOW_S - 1.5),
    ]
    assert report.not_taken == NotTaken(1, 2, 3, 4)
    assert report.retries == Retries(5, 6, 7, 8, 9)
    first, second = report.requests
    assert (first.action, first.recording_id, first.issued_by) == (HubAction.UPLOAD, "a", "anna")
    assert first.expires_s == NOW_S + 5
    assert (second.action, second.pre_s, second.post_s) == (HubAction.SNAPSHOT, 0, None)


def test_what_the_hub_can_choose_is_cut_and_printable() -> None:
    made = message()
    status = made.status
    huge = "\x1b]0;\u202eevil\n" + "x" * 100_000
    status.robot = status.fleet = status.uploads_paused = status.last_error = status.uploading_id = huge
    status.state_age_ms = status.last_sent_age_ms = 2**64 - 1
    status.uploading.reason = huge
    request = made.requests.add(request_id="u", issued_by="\u00e4nna\r\n" + huge, remaining_ms=2**64 - 1)
    request.upload.recording_id = huge
    made.requests.add(request_id=huge)
    made.requests.add(request_id="")
    made.requests.add(request_id="new")
    made.copies.add(recording_id=huge)
    made.copies.add(recording_id="")
    made.copies.add(recording_id="\n")
    made.copies.add(recording_id="newer").copy.state = 99  # type: ignore[assignment]  # the point of it
    report = wire.report_from(made, NOW_S)
    assert report.copies == ()
    texts = [report.status.robot, report.status.fleet, report.status.last_error, report.status.uploads_paused]
    assert all(each.isprintable() and len(each) <= wire.LONGEST_TEXT for each in texts)
    assert report.status.uploading_id == ""
    assert report.status.state_age_ms < 2**63
    known, unknown = report.requests
    assert (known.request_id, unknown.request_id, unknown.action) == ("u", "new", None)
    assert known.issued_by.isascii()
    assert known.issued_by.startswith("?nna")
    assert len(known.issued_by) <= wire.LONGEST_NAME
    assert len(known.recording_id) == wire.LONGEST_NAME + 1, "long enough to be refused"
    assert known.expires_s == NOW_S + 86_400


def test_lists_are_read_as_far_as_the_schema_permits() -> None:
    made = message()
    for number in range(10_000):
        made.copies.add(recording_id=str(number))
        made.requests.add(request_id=str(number))
    report = wire.report_from(made, NOW_S)
    assert len(report.copies) == wire.MOST_COPIES
    assert [each.request_id for each in report.requests] == ["0", "1", "2", "3"]


@pytest.mark.parametrize(
    ("code", "kind"),
    [
        (CODE.NOT_FOUND, NotFoundError),
        (CODE.FAILED_PRECONDITION, PreconditionError),
        (CODE.RESOURCE_EXHAUSTED, TooMuchError),
        (CODE.INVALID_ARGUMENT, InvalidRequestError),
        (CODE.UNAVAILABLE, BridgeUnreachableError),
        (CODE.DEADLINE_EXCEEDED, BridgeUnreachableError),
        (CODE.INTERNAL, DefectError),
    ],
)
def test_a_refusal_keeps_its_words_unless_it_is_a_defect(
    code: grpc.StatusCode, kind: type[DomainError]
) -> None:
    metadata = grpc.aio.Metadata()
    error = REFUSALS.refused(grpc.aio.AioRpcError(code, metadata, metadata, "its own words"))
    assert type(error) is kind
    assert ("its own words" in str(error)) == (kind not in (BridgeUnreachableError, DefectError))
