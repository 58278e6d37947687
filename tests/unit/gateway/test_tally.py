"""Calls and callers are counted, whatever becomes of a call."""

from typing import Any

import pytest

from common.errors import InvalidRequestError
from gateway.rpc.tally import RECENT_S, Counts, Tally


class Call:
    """A caller with a connection of its own."""

    def __init__(self, peer: str) -> None:
        self._peer = peer

    def peer(self) -> str:
        return self._peer


class Clock:
    now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


async def ask(tally: Tally, peer: str = "ipv4:10.0.0.1:1", raises: type[Exception] | None = None) -> bytes:
    async def behavior(_request: Any, _context: Any) -> bytes:
        if raises:
            raise raises
        return b"answer"

    context: Any = Call(peer)
    tally.note(peer)
    return await tally.counted("Get", behavior)(None, context)


async def test_answers_refusals_and_failures_are_told_apart() -> None:
    tally = Tally(Clock())
    assert await ask(tally) == b"answer"
    with pytest.raises(InvalidRequestError):
        await ask(tally, raises=InvalidRequestError)
    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            await ask(tally, raises=ZeroDivisionError)
    assert tally.methods == {"Get": Counts(served=1, refused=1, failed=2)}
    assert (tally.served, tally.refused) == (1, 1)


async def test_a_connection_is_a_client_while_it_asks() -> None:
    clock = Clock()
    tally = Tally(clock)
    assert tally.client_count() == 0
    await ask(tally, "a")
    await ask(tally, "b")
    await ask(tally, "a")
    assert tally.client_count() == 2
    clock.now_s += RECENT_S / 2
    await ask(tally, "a")
    clock.now_s += RECENT_S * 0.6
    assert tally.client_count() == 1


async def test_a_stream_of_new_connections_fills_no_memory() -> None:
    clock = Clock()
    tally = Tally(clock)
    for number in range(5000):
        await ask(tally, str(number))
    assert tally.client_count() == 1024


async def follow(tally: Tally, answers: int, raises: type[Exception] | None = None) -> list[bytes]:
    async def behavior(_request: Any, _context: Any) -> Any:
        for _ in range(answers):
            yield b"answer"
        if raises:
            raise raises

    context: Any = Call("a")
    return [each async for each in tally.counted_stream("Watch", behavior)(None, context)]


async def test_a_stream_is_served_once_however_much_it_tells() -> None:
    tally = Tally(Clock())
    assert await follow(tally, 3) == [b"answer"] * 3
    with pytest.raises(InvalidRequestError):
        await follow(tally, 0, raises=InvalidRequestError)
    with pytest.raises(ZeroDivisionError):
        await follow(tally, 0, raises=ZeroDivisionError)
    assert tally.methods == {"Watch": Counts(served=1, refused=1, failed=1)}


async def test_who_is_told_something_is_a_client() -> None:
    clock = Clock()
    tally = Tally(clock)

    async def behavior(_request: Any, _context: Any) -> Any:
        while True:
            yield b"answer"

    context: Any = Call("a")
    stream = tally.counted_stream("Watch", behavior)(None, context)
    await anext(stream)
    clock.now_s += RECENT_S * 2
    assert tally.client_count() == 0
    await anext(stream)
    assert tally.client_count() == 1
