"""Exports are counted by caller: a computer that may choose among the addresses of a /64 is one of them."""

from collections.abc import AsyncGenerator
from contextlib import AsyncExitStack, aclosing
from typing import Any

import pytest

from common.errors import TooMuchError
from common.reasons import Reason
from gateway.rpc.responses.export_stream import MAX_OF_A_CALLER, ExportStream
from gateway.rpc.services.recording import RecordingService
from omniseer.gateway.v1.recording_pb2 import ExportRecordingRequest
from tests.support.calls import call_of


class Recorder:
    """Has a file without end."""

    def __init__(self) -> None:
        self.callers: list[str] = []

    async def export(self, _request: bytes, caller: str) -> AsyncGenerator[bytes]:
        self.callers.append(caller)
        while True:
            yield b"x"


def begun(service: RecordingService, address: str) -> Any:
    return service.export_recording(ExportRecordingRequest(), call_of(peer=address))


@pytest.mark.parametrize(
    ("addresses", "other"),
    [
        ([f"ipv6:%5B2001:db8::{number}%5D:4711" for number in range(1, 6)], "ipv6:%5B2001:db8:1::1%5D:4711"),
        (["ipv6:%5B::ffff:10.0.0.5%5D:1", "ipv4:10.0.0.5:2"] * 3, "ipv4:10.0.0.6:1"),
    ],
)
async def test_addresses_that_one_computer_may_choose_share_its_places(
    addresses: list[str], other: str
) -> None:
    recorder: Any = Recorder()
    service = RecordingService(recorder, ExportStream(), None)
    async with AsyncExitStack() as stack:
        for address in addresses[:MAX_OF_A_CALLER]:
            responses = await stack.enter_async_context(aclosing(begun(service, address)))
            assert await anext(responses) == b"x"
        with pytest.raises(TooMuchError) as error:
            await anext(begun(service, addresses[MAX_OF_A_CALLER]))
        assert error.value.reason is Reason.TOO_MANY_EXPORTS
        responses = await stack.enter_async_context(aclosing(begun(service, other)))
        assert await anext(responses) == b"x"
    assert len(recorder.callers) == MAX_OF_A_CALLER + 1
    assert "2001:db8::1" in recorder.callers or "10.0.0.5" in recorder.callers, "addresses are for people"
