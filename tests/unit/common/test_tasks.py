"""Tasks that end together: none is left running, and no error is lost."""

import asyncio

import pytest

from common.tasks import cancel, first_to_end


async def _fail_when_cancelled() -> None:
    try:
        await asyncio.Event().wait()
    except asyncio.CancelledError:
        raise OSError("the clean-up failed") from None


def test_cancelled_tasks_have_ended_and_say_how() -> None:
    async def run() -> None:
        done = asyncio.create_task(asyncio.sleep(0, "done"))
        endless = asyncio.create_task(asyncio.Event().wait())
        failing = asyncio.create_task(_fail_when_cancelled())
        await done
        result, cancelled, error = await cancel([done, endless, failing])
        assert result == "done"
        assert isinstance(cancelled, asyncio.CancelledError)
        assert isinstance(error, OSError)
        assert endless.cancelled()
        assert failing.done()

    asyncio.run(run())


def test_no_tasks_are_cancelled_at_once() -> None:
    assert asyncio.run(cancel([])) == []


def test_a_set_that_loses_tasks_as_they_end_is_cancelled_whole() -> None:
    async def run() -> None:
        tasks = {asyncio.create_task(asyncio.Event().wait()) for _ in range(5)}
        for task in tasks:
            task.add_done_callback(tasks.discard)
        await asyncio.sleep(0)
        assert len(await cancel(tasks)) == 5

    asyncio.run(run())


def test_the_first_to_end_ends_the_others() -> None:
    async def run() -> bool:
        cleaned_up = False

        async def endless() -> None:
            nonlocal cleaned_up
            try:
                await asyncio.Event().wait()
            finally:
                await asyncio.sleep(0)
                cleaned_up = True

        await first_to_end(endless(), asyncio.sleep(0))
        return cleaned_up

    assert asyncio.run(run())


def test_the_first_to_end_raises_its_error() -> None:
    async def fail() -> None:
        raise OSError("lost")

    with pytest.raises(OSError, match="lost"):
        asyncio.run(first_to_end(asyncio.Event().wait(), fail()))
