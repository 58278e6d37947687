"""An answer that comes late is asked for again, and nothing else is."""

import grpc
import pytest

from tests.support.answered import answered


class EndedError(grpc.RpcError):
    """A call that has ended with a code."""

    def __init__(self, code: grpc.StatusCode) -> None:
        super().__init__()
        self._code = code

    def code(self) -> grpc.StatusCode:
        return self._code


def test_a_late_answer_is_asked_for_again() -> None:
    late = [EndedError(grpc.StatusCode.DEADLINE_EXCEEDED) for _ in range(2)]

    def ask() -> str:
        if late:
            raise late.pop()
        return "here"

    assert answered(ask) == "here"
    assert not late


@pytest.mark.parametrize(
    ("code", "within_s"), [(grpc.StatusCode.UNAVAILABLE, 20.0), (grpc.StatusCode.DEADLINE_EXCEEDED, 0.0)]
)
def test_a_program_that_is_gone_and_one_that_never_answers_are_errors(
    code: grpc.StatusCode, within_s: float
) -> None:
    ended = EndedError(code)

    def ask() -> str:
        raise ended

    with pytest.raises(EndedError) as caught:
        answered(ask, within_s)
    assert caught.value is ended
