"""The call of a stream is let go of when its reader leaves, at whatever point: no gRPC."""

import asyncio
import gc
import weakref
from collections.abc import AsyncIterator
from typing import Any

import pytest

from console.client.errors import GatewayFailed
from console.client.mapping.methods import SUBSCRIBE_EVENTS
from console.client.transport import Responses

WAITING = 64
"""Items that wait at the most, as console.client.transport has it."""


class Call:
    """A call with so many responses, which then ends, or goes on without any."""

    def __init__(self, responses: int, *, ends: bool) -> None:
        self.cancelled = False
        self._responses, self._ends = responses, ends

    async def __aiter__(self) -> AsyncIterator[bytes]:
        for _ in range(self._responses):
            yield b""
        if not self._ends:
            await asyncio.Event().wait()

    def cancel(self) -> None:
        self.cancelled = True


class Transport:
    """What responses need of it."""

    def decode(self, _method: Any, answer: bytes) -> bytes:
        return answer

    def end_of_stream(self, _failure: Any) -> GatewayFailed:
        return GatewayFailed("it ended")

    def check_open(self) -> None:
        pass


async def settle() -> None:
    """Lets everything go on that waits for nothing."""
    for _ in range(2 * WAITING):
        await asyncio.sleep(0)


@pytest.mark.parametrize(
    ("responses", "ends"),
    [(0, False), (0, True), (WAITING, True), (WAITING + 1, True)],
    ids=["waiting", "ended", "ended with a full queue", "with a full queue"],
)
async def test_a_reader_that_leaves_keeps_no_call(responses: int, ends: bool) -> None:
    transport: Any = Transport()
    gc.collect()
    gc.disable()
    try:
        call = Call(responses, ends=ends)
        found = weakref.ref(call)
        stream = Responses(call, SUBSCRIBE_EVENTS, transport, newest_only=False)
        await settle()
        stream.cancel()
        await settle()
        del call
        assert found() is None
    finally:
        gc.enable()


class Unreadable(Transport):
    """Finds each response unreadable."""

    def decode(self, _method: Any, _answer: bytes) -> bytes:
        raise GatewayFailed("it is unreadable")


async def test_nor_does_an_unreadable_response() -> None:
    transport: Any = Unreadable()
    gc.collect()
    gc.disable()
    try:
        call = Call(1, ends=False)
        found = weakref.ref(call)
        stream = Responses(call, SUBSCRIBE_EVENTS, transport, newest_only=False)
        with pytest.raises(GatewayFailed, match="unreadable"):
            await stream.read(20)
        assert call.cancelled
        await settle()
        del call
        assert found() is None
    finally:
        gc.enable()
