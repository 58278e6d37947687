"""A deadline that also holds in a task that is being cancelled, as in its `finally`."""

import asyncio
from collections.abc import Awaitable
from typing import TypeVar

T = TypeVar("T")


async def within(seconds: float, work: Awaitable[T]) -> T:
    """Returns the result of some work, which is cancelled when there is none in time.

    asyncio.timeout of Python 3.11.2, Debian 12's, raises CancelledError instead of TimeoutError in a task
    that is being cancelled already; asyncio.wait_for before 3.12 loses a cancellation that comes with
    the result (bpo-42130).

    Raises:
        TimeoutError: no result within `seconds`.
    """
    future = asyncio.ensure_future(work)
    try:
        await asyncio.wait({future}, timeout=seconds)
        if not future.done():
            raise TimeoutError
        return future.result()
    finally:
        future.cancel()
