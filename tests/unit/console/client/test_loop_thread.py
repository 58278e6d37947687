"""The loop thread of the blocking client, where others would wait for themselves."""

import asyncio
import subprocess
import sys
from collections.abc import Iterator

import pytest

from console.client.errors import Cancelled
from console.client.loop_thread import LoopThread, SharedLoop


@pytest.fixture
def loop() -> Iterator[LoopThread]:
    loop = LoopThread()
    yield loop
    loop.stop()


async def seven() -> int:
    return 7


def test_a_result_comes_back(loop: LoopThread) -> None:
    assert loop.run(seven()) == 7


def test_in_its_own_thread_a_blocking_call_ends_at_once(loop: LoopThread) -> None:
    async def block() -> None:
        loop.run(seven())

    with pytest.raises(Cancelled, match="own thread"):
        loop.run(block())


def test_a_garbage_collection_within_submit_may_submit(
    loop: LoopThread, monkeypatch: pytest.MonkeyPatch
) -> None:
    really_submit = asyncio.run_coroutine_threadsafe

    def collecting(*args: object) -> object:
        monkeypatch.setattr(asyncio, "run_coroutine_threadsafe", really_submit)
        loop.submit(seven()).result(5)
        return really_submit(*args)  # type: ignore[arg-type]  # passed on

    monkeypatch.setattr(asyncio, "run_coroutine_threadsafe", collecting)
    assert loop.run(seven()) == 7


def test_a_stopped_one_says_so(loop: LoopThread) -> None:
    loop.stop()
    with pytest.raises(Cancelled, match="closed"):
        loop.run(seven())


def test_its_users_share_one_loop() -> None:
    shared = SharedLoop()
    first, second = shared.acquire(), shared.acquire()
    assert first is second
    shared.release(first)
    assert second.run(seven()) == 7
    shared.release(second)
    with pytest.raises(Cancelled, match="closed"):
        second.run(seven())
    third = shared.acquire()
    assert third is not first
    shared.release(first)
    assert third.run(seven()) == 7, "a loop of the past has no users to release"
    shared.release(third)


def test_after_a_fork_it_says_what_to_do() -> None:
    program = """
import os
from console.client.errors import Cancelled
from console.client.loop_thread import LoopThread

async def seven():
    return 7

loop = LoopThread()
if os.fork() == 0:
    try:
        loop.run(seven())
    except Cancelled as error:
        print(error.what, flush=True)
    loop.stop()
    os._exit(0)
os.wait()
assert loop.run(seven()) == 7
loop.stop()
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=30, check=True
    )
    assert "belongs to the parent process" in done.stdout
