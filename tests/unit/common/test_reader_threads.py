"""Jobs run beside the loop, as many as permitted, and have ended when their caller goes on."""

import asyncio
import os
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from common.errors import TooMuchError
from common.reader_threads import ClosedError, ReaderThreads
from common.reasons import Reason

MOST = 3


@pytest.fixture
def threads() -> Iterator[ReaderThreads]:
    made = ReaderThreads("files", threads=1, most=MOST)
    yield made
    made.close()


async def test_a_job_has_its_result_or_its_error(threads: ReaderThreads) -> None:
    assert await threads.run(divmod, 7, 2) == (3, 1)
    with pytest.raises(ZeroDivisionError):
        await threads.run(divmod, 7, 0)


async def test_more_than_permitted_are_refused_with_what_to_do(threads: ReaderThreads) -> None:
    goes_on = threading.Event()
    jobs = [asyncio.create_task(threads.run(goes_on.wait)) for _ in range(MOST)]
    await asyncio.sleep(0)
    with pytest.raises(TooMuchError, match="try again in a moment") as refusal:
        await threads.run(goes_on.wait)
    assert refusal.value.reason is Reason.TOO_MANY_REQUESTS
    goes_on.set()
    assert await asyncio.gather(*jobs) == [True] * MOST
    assert await threads.run(goes_on.wait), "their places are free again"


async def test_a_cancelled_caller_waits_for_a_job_that_runs_and_drops_one_that_does_not(
    threads: ReaderThreads,
) -> None:
    goes_on, runs, ran = threading.Event(), threading.Event(), []

    def work() -> None:
        runs.set()
        goes_on.wait()
        ran.append("first")

    first = asyncio.create_task(threads.run(work))
    second = asyncio.create_task(threads.run(ran.append, "second"))
    await asyncio.to_thread(runs.wait)
    for each in (first, second, first):
        each.cancel()
        await asyncio.sleep(0)
    await asyncio.wait({second})
    assert not first.done()
    goes_on.set()
    await asyncio.wait({first})
    assert first.cancelled()
    assert second.cancelled()
    assert ran == ["first"]


async def test_a_file_that_is_opened_for_a_caller_who_has_left_is_closed(
    threads: ReaderThreads, tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    goes_on, opened = threading.Event(), []

    def work() -> int:
        goes_on.wait()
        opened.append(os.open(tmp_path / "file", os.O_RDONLY))
        return opened[0]

    opening = asyncio.create_task(threads.opened(work))
    await asyncio.sleep(0)
    opening.cancel()
    goes_on.set()
    await asyncio.wait({opening})
    if opened:
        with pytest.raises(OSError, match="Bad file descriptor"):
            os.fstat(opened[0])


async def test_nothing_is_read_after_the_end(threads: ReaderThreads) -> None:
    goes_on = threading.Event()
    runs, waits = (asyncio.create_task(threads.run(goes_on.wait)) for _ in range(2))
    await asyncio.sleep(0)
    threads.close()
    with pytest.raises(ClosedError):
        await threads.run(goes_on.wait)
    goes_on.set()
    assert await runs
    await asyncio.wait({waits})
    assert waits.cancelled()
