"""The id of a request: its source, when it is generated, and which ids are rejected."""

import asyncio
from typing import Any

import pytest

from common import request_id


class Call:
    """A call with metadata, that counts who looks at it."""

    def __init__(self, *metadata: tuple[str, Any]) -> None:
        self._metadata = metadata
        self.looks = 0

    def invocation_metadata(self) -> Any:
        self.looks += 1
        return self._metadata


def served(call: Call, looks: int = 2) -> list[str]:
    """What is seen as the current id, in a task of its own as in a server."""

    async def serve() -> list[str]:
        request_id.begin(call)
        return [request_id.current() for _ in range(looks)]

    return asyncio.run(serve())


def test_outside_of_requests_there_is_none() -> None:
    assert request_id.current() == ""


def test_the_callers_own_id_is_kept() -> None:
    assert served(Call(("user-agent", "x"), (request_id.HEADER, "shift-7:42"))) == ["shift-7:42"] * 2


def test_without_one_each_request_gets_another() -> None:
    first, again = served(Call())
    assert first == again
    assert served(Call())[0] != first


@pytest.mark.parametrize("unfit", ["", "a b", "a\nERROR fake", "x" * 65, b"bytes", "ä"])
def test_what_could_fake_a_log_line_is_replaced(unfit: Any) -> None:
    (seen,) = served(Call((request_id.HEADER, unfit)), looks=1)
    assert seen != unfit
    assert len(seen) == 16


def test_a_request_that_logs_nothing_costs_no_look() -> None:
    call = Call((request_id.HEADER, "unseen"))
    served(call, looks=0)
    assert call.looks == 0


def test_what_is_done_for_a_request_later_carries_its_id() -> None:
    with request_id.continuing("of-the-request"):
        assert request_id.current() == "of-the-request"
        with request_id.continuing(""):
            assert request_id.current() == ""
        assert request_id.current() == "of-the-request"
    assert request_id.current() == ""
