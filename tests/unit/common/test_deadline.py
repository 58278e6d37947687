"""Deadlines, also of tasks that are being cancelled."""

import asyncio

import pytest

from common.deadline import within


async def _failing() -> None:
    raise ZeroDivisionError


async def test_a_result_and_an_error_come_back() -> None:
    assert await within(5, asyncio.sleep(0, "result")) == "result"
    with pytest.raises(ZeroDivisionError):
        await within(5, _failing())


async def test_work_that_takes_too_long_is_cancelled() -> None:
    work = asyncio.ensure_future(asyncio.sleep(60))
    with pytest.raises(TimeoutError):
        await within(0.01, work)
    with pytest.raises(asyncio.CancelledError):
        await work


async def test_a_cancellation_that_comes_with_the_result_is_not_lost() -> None:
    result: asyncio.Future[None] = asyncio.get_running_loop().create_future()
    task = asyncio.create_task(within(5, result))
    await asyncio.sleep(0)
    result.set_result(None)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task


async def test_it_holds_in_a_task_that_is_being_cancelled() -> None:
    tidied = False

    async def tidies_up() -> None:
        nonlocal tidied
        try:
            await asyncio.sleep(60)
        finally:
            with pytest.raises(TimeoutError):
                await within(0.01, asyncio.sleep(60))
            tidied = True

    task = asyncio.create_task(tidies_up())
    await asyncio.sleep(0)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert tidied
