"""The loop that blocking code hands its coroutines to."""

import asyncio
import threading
from collections.abc import Iterator

import pytest

from console.client.errors import Cancelled
from console.client.loop_thread import LoopThread


@pytest.fixture
def loop() -> Iterator[LoopThread]:
    loop = LoopThread()
    yield loop
    loop.stop()


async def thread_name() -> str:
    return threading.current_thread().name


def test_a_coroutine_runs_in_the_loops_thread(loop: LoopThread) -> None:
    assert loop.run(thread_name()) == "gateway-client"


def test_its_exception_is_raised_where_it_was_handed_in(loop: LoopThread) -> None:
    async def fail() -> None:
        raise KeyError("reason")

    with pytest.raises(KeyError, match="reason"):
        loop.run(fail())


def test_stopping_cancels_what_is_pending_and_refuses_what_comes_later(loop: LoopThread) -> None:
    started = threading.Event()
    outcome: list[Exception] = []

    async def wait() -> None:
        started.set()
        await asyncio.Event().wait()

    def call() -> None:
        try:
            loop.run(wait())
        except Cancelled as error:
            outcome.append(error)

    caller = threading.Thread(target=call)
    caller.start()
    assert started.wait(10)
    loop.stop()
    caller.join(10)
    assert [type(error) for error in outcome] == [Cancelled]
    with pytest.raises(Cancelled):
        loop.run(thread_name())
    loop.stop()


def test_stopping_from_its_own_thread_does_not_wait_for_itself(loop: LoopThread) -> None:
    async def stop_and_wait() -> None:
        loop.stop()
        await asyncio.Event().wait()

    with pytest.raises(Cancelled):
        loop.run(stop_and_wait())
