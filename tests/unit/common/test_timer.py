"""A call that is due later."""

import asyncio

from common.timer import Timer
from tests.support.virtual_time import in_virtual_time


@in_virtual_time
async def test_it_calls_once_when_the_time_is_up() -> None:
    calls: list[float] = []
    timer = Timer(lambda: calls.append(asyncio.get_running_loop().time()))
    began_s = asyncio.get_running_loop().time()
    assert not timer
    timer.start(2.0)
    assert timer
    await asyncio.sleep(10.0)
    assert [at_s - began_s for at_s in calls] == [2.0]
    assert not timer


@in_virtual_time
async def test_started_again_it_begins_anew_and_cancelled_it_does_not_call() -> None:
    calls: list[float] = []
    timer = Timer(lambda: calls.append(asyncio.get_running_loop().time()))
    began_s = asyncio.get_running_loop().time()
    timer.start(2.0)
    await asyncio.sleep(1.0)
    timer.start(2.0)
    await asyncio.sleep(5.0)
    assert [at_s - began_s for at_s in calls] == [3.0]
    timer.start(2.0)
    assert timer.cancel()
    assert not timer.cancel()
    await asyncio.sleep(5.0)
    assert len(calls) == 1
