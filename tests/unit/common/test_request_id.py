"""The id of a request: its source, when it is generated, and which ids are rejected."""

import asyncio
from typing import Any

import pytest

from common import request_id


class Call:
    """A call with metadata, which gRPC frees when it ends."""

    def __init__(self, *metadata: tuple[str, Any]) -> None:
        self._metadata = metadata
        self.ended = False

    def invocation_metadata(self) -> Any:
        assert not self.ended, "gRPC would read memory that it has freed"
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


@pytest.mark.parametrize("metadata", [(), ((request_id.HEADER, "of-the-call"),)])
def test_what_a_call_has_started_has_its_id_after_its_end(metadata: tuple[tuple[str, str], ...]) -> None:
    """A preview that stops by itself is a timer of the gateway's last call, which has ended by then."""

    async def serve() -> str:
        call, expired = Call(*metadata), asyncio.get_running_loop().create_future()
        request_id.begin(call)
        asyncio.get_running_loop().call_soon(lambda: expired.set_result(request_id.current()))
        call.ended = True
        async with asyncio.timeout(5):
            seen: str = await expired
        assert seen == request_id.current()
        return seen

    seen = asyncio.run(serve())
    assert (seen == "of-the-call") if metadata else (len(seen) == 16)


def test_what_is_done_for_a_request_later_carries_its_id() -> None:
    with request_id.continuing("of-the-request"):
        assert request_id.current() == "of-the-request"
        with request_id.continuing(""):
            assert request_id.current() == ""
        assert request_id.current() == "of-the-request"
    assert request_id.current() == ""
