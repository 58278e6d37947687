"""Tasks of an event loop that end together."""

import asyncio
from collections.abc import Coroutine, Iterable
from typing import Any


async def cancel(tasks: Iterable[asyncio.Future[Any]]) -> list[object]:
    """Cancels tasks, waits until each has ended, and returns their results and errors in the same order."""
    ending = list(tasks)
    for task in ending:
        task.cancel()
    ended: list[object] = await asyncio.gather(*ending, return_exceptions=True)
    return ended


async def end(tasks: Iterable[asyncio.Future[Any]]) -> None:
    """Cancels tasks and waits until each has ended. Raises the first error of one that has failed."""
    for outcome in await cancel(tasks):
        if isinstance(outcome, BaseException) and not isinstance(outcome, asyncio.CancelledError):
            raise outcome


async def first_to_end(*parts: Coroutine[Any, Any, object]) -> None:
    """Runs coroutines until one ends, then cancels the others. Raises the error of the one that ended."""
    tasks = [asyncio.create_task(part) for part in parts]
    try:
        ended, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in ended:
            task.result()
    finally:
        await cancel(tasks)
