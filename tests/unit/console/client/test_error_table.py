"""Each gRPC status code means one thing to people."""

from pathlib import Path
from typing import Any

import grpc
import pytest
from google.protobuf.duration_pb2 import Duration
from google.rpc.error_details_pb2 import RetryInfo
from google.rpc.status_pb2 import Status

from common.errors import (
    DefectError,
    DomainError,
    ExitCode,
    FieldViolation,
    InvalidRequestError,
    NotAllowedError,
    TooMuchError,
)
from common.grpc_errors import STATUS_CODES, metadata_of
from common.reasons import Reason
from console.client import errors
from console.client.error_table import ERRORS, REASONS, error_from
from tests.support.control_characters import CONTROL_CHARACTERS


class Failure(grpc.RpcError):
    def __init__(self, code: grpc.StatusCode, details: str | None, metadata: Any = ()) -> None:
        super().__init__()
        self._metadata = metadata
        self._code = code
        self._details = details

    def code(self) -> grpc.StatusCode:
        return self._code

    def details(self) -> str | None:
        return self._details

    def trailing_metadata(self) -> Any:
        return self._metadata


def said(code: grpc.StatusCode, details: str | None = "because") -> errors.GatewayError:
    return error_from(Failure(code, details), "robot:50051", 2.0)


def all_errors(above: type[errors.GatewayError]) -> set[type[errors.GatewayError]]:
    below = set(above.__subclasses__())
    return below.union(*(all_errors(one) for one in below))


def test_the_table_is_total_in_both_directions() -> None:
    assert set(ERRORS) == set(grpc.StatusCode)
    # Whom a connection led to is known before any code of a gateway's own comes, and that a client was closed
    # without one.
    assert set(ERRORS.values()) | {errors.NotTrusted, errors.Cancelled} == all_errors(errors.GatewayError)


@pytest.mark.parametrize(
    ("details", "words"),
    [
        ("SSL_ERROR_SSL: CERTIFICATE_VERIFY_FAILED: unable to get local issuer certificate", "not signed by"),
        ("CERTIFICATE_VERIFY_FAILED: certificate has expired", "has expired"),
        ("CERTIFICATE_VERIFY_FAILED: certificate is not yet valid", "this computer's clock"),
        ("Hostname Verification Check failed.", "other names"),
    ],
)
def test_who_can_not_prove_to_be_the_robot_is_not_trusted(details: str, words: str) -> None:
    error = said(grpc.StatusCode.UNAVAILABLE, details)
    assert type(error) is errors.NotTrusted
    assert words in error.what
    assert "robotctl login" in error.remedy


def test_every_kind_is_a_word_of_its_own() -> None:
    family = all_errors(errors.GatewayError)
    assert len({one.kind for one in family}) == len(family)


@pytest.mark.parametrize("code", list(grpc.StatusCode), ids=lambda code: code.name)
def test_every_error_names_the_robot_and_says_what_to_do(code: grpc.StatusCode) -> None:
    error = said(code)
    assert type(error) is ERRORS[code]
    assert "robot:50051" in error.what
    assert error.remedy
    assert "\n" not in str(error)


@pytest.mark.parametrize("code", [grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.DEADLINE_EXCEEDED])
def test_a_robot_that_does_not_answer_ends_a_program_with_3(code: grpc.StatusCode) -> None:
    assert said(code).exit_code is ExitCode.UNREACHABLE


@pytest.mark.parametrize("code", [grpc.StatusCode.INVALID_ARGUMENT, grpc.StatusCode.INTERNAL])
def test_a_robot_that_answers_no_ends_a_program_with_1(code: grpc.StatusCode) -> None:
    assert said(code).exit_code is ExitCode.FAILED


@pytest.mark.parametrize(
    ("details", "plain"),
    [
        ("last error: UNKNOWN: ipv4:127.0.0.1:1: Connection refused", "nothing listens there"),
        ("ipv4:127.0.0.1:1: tcp handshaker shutdown", "no answer"),
        ("errors resolving x: Domain name not found", "the name does not resolve"),
        ("connection attempt timed out before receiving SETTINGS frame", "does not answer as a gateway"),
        ("an unknown message", "an unknown message"),
    ],
)
def test_grpcs_reasons_in_plain_words(details: str, plain: str) -> None:
    assert said(grpc.StatusCode.UNAVAILABLE, details).what.endswith(plain)


def test_the_robots_own_words_come_through() -> None:
    assert said(grpc.StatusCode.INVALID_ARGUMENT, "profile 99 is unknown").what.endswith(
        "profile 99 is unknown"
    )


def test_a_call_that_the_gateway_cancelled_is_not_one_of_a_closed_client() -> None:
    error = said(grpc.StatusCode.CANCELLED, "Received RST_STREAM with error code 8")
    assert type(error) is errors.Unreachable
    assert error.what == (
        "the robot gateway at robot:50051 cancelled the call: it stops, or has more calls than it can take"
    )
    assert error.remedy == "Try again"


def test_without_details_the_code_speaks() -> None:
    assert "INTERNAL" in said(grpc.StatusCode.INTERNAL, None).what


def refused(error: DomainError) -> errors.GatewayError:
    """What a client makes of this error of a gateway."""
    code = STATUS_CODES[type(error)]
    return error_from(Failure(code, str(error), metadata_of(error, code)), "robot:50051", 2.0)


def test_every_reason_has_its_place_in_the_family() -> None:
    assert set(REASONS) == set(Reason)


@pytest.mark.parametrize("reason", list(Reason))
def test_a_reason_counts_more_than_the_code(reason: Reason) -> None:
    error = refused(TooMuchError("too much", reason, 0.25))
    assert type(error) is REASONS[reason]
    assert (error.reason, error.retry_after_s) == (reason, 0.25)


def test_what_to_do_fits_the_reason_and_else_the_family() -> None:
    assert "with that role" in str(refused(NotAllowedError("ben is viewer")))
    assert "share one" in str(refused(TooMuchError("too much", Reason.TOO_MANY_STREAMS)))
    assert errors.NotAllowed.advice in str(refused(TooMuchError("no", Reason.CREDENTIAL_MISSING)))
    assert "FILE --replace" in str(refused(TooMuchError("no", Reason.CREDENTIAL_REVOKED)))


def test_the_fields_of_a_bad_request_are_named() -> None:
    violations = (FieldViolation("min_interval_ms", "is too much"), FieldViolation("", "as a whole"))
    error = refused(InvalidRequestError("two things", violations))
    assert isinstance(error, errors.InvalidRequest)
    assert error.fields == ("min_interval_ms", "")
    assert error.retry_after_s is None


def test_a_defect_has_a_reason_too() -> None:
    assert refused(DefectError("internal error")).reason == Reason.INTERNAL


@pytest.mark.parametrize(
    "metadata",
    [None, (), (("grpc-status-details-bin", b"\xff\xff"),), (("grpc-status-details-bin", b""),)],
)
def test_without_readable_details_the_code_speaks_alone(metadata: Any) -> None:
    error = error_from(Failure(grpc.StatusCode.RESOURCE_EXHAUSTED, "no", metadata), "robot:50051", 2.0)
    assert type(error) is errors.Overloaded
    assert (error.reason, error.fields, error.retry_after_s) == ("", (), None)


@pytest.mark.parametrize(
    ("seconds", "nanos", "retry_after_s"),
    [(0, 250_000_000, 0.25), (0, -1, None), (-1, 0, None), (-(2**63), 0, None), (10**10, 0, None)],
)
def test_only_a_delay_that_can_be_waited_is_one(
    seconds: int, nanos: int, retry_after_s: float | None
) -> None:
    """A program may hand it to time.sleep(), which raises for a negative one and for one without end."""
    status = Status()
    status.details.add().Pack(RetryInfo(retry_delay=Duration(seconds=seconds, nanos=nanos)))
    metadata = (("grpc-status-details-bin", status.SerializeToString()),)
    error = error_from(Failure(grpc.StatusCode.RESOURCE_EXHAUSTED, "no", metadata), "robot:50051", 2.0)
    assert error.retry_after_s == retry_after_s


def test_a_word_of_a_newer_gateway_leaves_the_code_to_speak(monkeypatch: pytest.MonkeyPatch) -> None:
    error = TooMuchError("hm", Reason.TOO_MANY_REQUESTS)
    monkeypatch.setattr(error, "reason", _Newer())
    code = grpc.StatusCode.RESOURCE_EXHAUSTED
    seen = error_from(Failure(code, "hm", metadata_of(error, code)), "robot:50051", 2.0)
    assert (type(seen), seen.reason) == (errors.Overloaded, "A_NEWER_WORD")


class _Newer:
    value = "A_NEWER_WORD"


def test_the_page_gives_every_reason_its_code_and_exception() -> None:
    page = (Path(__file__).parents[4] / "docs/errors.md").read_text(encoding="utf-8")
    rows = [
        [cell.strip(" `") for cell in line.strip("|").split("|")]
        for line in page.splitlines()
        if line.startswith("| `")
    ]
    assert [row[0] for row in rows] == list(dict.fromkeys(row[0] for row in rows)), "each once"
    assert {row[0]: row[-1] for row in rows} == {
        str(reason): family.__name__ for reason, family in REASONS.items()
    }
    fixed = {error.reason: code for error, code in STATUS_CODES.items() if hasattr(error, "reason")}
    for row in rows:
        code = fixed.get(Reason(row[0]))
        assert code is None or row[1] == code.name


def test_what_a_server_says_holds_no_control_character() -> None:
    error = said(grpc.StatusCode.FAILED_PRECONDITION, f"no{CONTROL_CHARACTERS}")
    assert not set(error.what) & set(CONTROL_CHARACTERS)
