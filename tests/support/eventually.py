"""Waiting for a condition in a test that lives in an event loop."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import TypeVar

T = TypeVar("T")


async def eventually(
    ask: Callable[[], Awaitable[T]], holds: Callable[[T], object], what: str, within_s: float = 15.0
) -> T:
    """Asks again and again until the answer will do, and gives it; fails the test after `within_s`."""
    loop = asyncio.get_running_loop()
    deadline = loop.time() + within_s
    while not holds(answer := await ask()):
        assert loop.time() < deadline, f"not within {within_s:g} s: {what}; last: {answer}"
        await asyncio.sleep(0.01)
    return answer
