"""Each gRPC status code means one thing to people."""

import grpc
import pytest

from common.errors import ExitCode
from console.client import errors
from console.client.error_table import ERRORS, error_from


class Failure(grpc.RpcError):
    def __init__(self, code: grpc.StatusCode, details: str | None) -> None:
        super().__init__()
        self._code = code
        self._details = details

    def code(self) -> grpc.StatusCode:
        return self._code

    def details(self) -> str | None:
        return self._details


def said(code: grpc.StatusCode, details: str | None = "because") -> errors.GatewayError:
    return error_from(Failure(code, details), "robot:50051", 2.0)


def all_errors(above: type[errors.GatewayError]) -> set[type[errors.GatewayError]]:
    below = set(above.__subclasses__())
    return below.union(*(all_errors(one) for one in below))


def test_the_table_is_total_in_both_directions() -> None:
    assert set(ERRORS) == set(grpc.StatusCode)
    assert set(ERRORS.values()) == all_errors(errors.GatewayError)


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
        ("words nobody has seen yet", "words nobody has seen yet"),
    ],
)
def test_grpcs_reasons_in_plain_words(details: str, plain: str) -> None:
    assert said(grpc.StatusCode.UNAVAILABLE, details).what.endswith(plain)


def test_the_robots_own_words_come_through() -> None:
    assert said(grpc.StatusCode.INVALID_ARGUMENT, "profile 99 is unknown").what.endswith(
        "profile 99 is unknown"
    )


def test_without_details_the_code_speaks() -> None:
    assert "INTERNAL" in said(grpc.StatusCode.INTERNAL, None).what
