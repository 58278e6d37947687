"""Blocking calls in threads: what they return, raise and release."""

import asyncio
import threading
import weakref
from concurrent.futures import Future
from functools import partial
from typing import Any

import pytest

from preview.pipeline import threads
from preview.pipeline.threads import SharedCall, in_thread
from tests.support.waiting import wait_until


class Element:
    """Something that a call references."""


async def test_a_result_and_an_error_come_back() -> None:
    assert await in_thread(lambda: 7, 5) == 7
    with pytest.raises(ZeroDivisionError):
        await in_thread(lambda: 1 // 0, 5)


async def test_a_call_that_does_not_return_is_given_up() -> None:
    returns = threading.Event()
    with pytest.raises(TimeoutError):
        await in_thread(returns.wait, 0.01)
    returns.set()


async def test_a_call_that_hangs_is_shared_until_it_returns() -> None:
    returns, begun = threading.Event(), list[int]()

    def work(number: int) -> int:
        begun.append(number)
        returns.wait(5)
        return number

    call = SharedCall[int]()
    for number in range(3):
        with pytest.raises(TimeoutError):
            await call.result(partial(work, number), 0.01)
    assert len(begun) <= 1
    waiting = [asyncio.create_task(call.result(partial(work, number), 5)) for number in (3, 4)]
    await asyncio.sleep(0)
    returns.set()
    assert await asyncio.gather(*waiting) == [0, 0]
    assert await call.result(partial(work, 5), 5) == 5
    assert begun == [0, 5]


async def test_what_a_call_references_is_free_before_its_result_is_seen(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Also where the thread is not scheduled again for a while."""
    seen = threading.Event()

    class Preempted(Future[Any]):
        def set_result(self, result: Any) -> None:
            super().set_result(result)
            seen.wait(5)

    monkeypatch.setattr(threads, "Future", Preempted)
    element = Element()
    alive = weakref.ref(element)
    await in_thread(partial(isinstance, element, Element), 5)
    del element
    try:
        assert alive() is None
    finally:
        seen.set()


async def test_a_cancellation_that_comes_with_the_result_is_not_lost() -> None:
    returned = threading.Event()
    task = asyncio.create_task(in_thread(returned.set, 5))
    await asyncio.sleep(0)
    # The result is on its way to the loop, which does not run meanwhile.
    assert returned.wait(5)
    wait_until(
        lambda: all(each.name != "blocking-call" for each in threading.enumerate()), "the thread's end", 5
    )
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
