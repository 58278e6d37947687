"""Waiting for a condition in a test that lives in an event loop."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
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


@asynccontextmanager
async def at_most(within_s: float, what: str) -> AsyncIterator[None]:
    """A block that fails the test after `within_s`, with an AssertionError: a stall may explain that."""
    try:
        async with asyncio.timeout(within_s) as limit:
            yield
    except TimeoutError as error:
        if not limit.expired():
            raise
        raise AssertionError(f"not within {within_s:g} s: {what}") from error
