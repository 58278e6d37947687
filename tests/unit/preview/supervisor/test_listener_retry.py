"""When a listener that has failed is opened again, in virtual time: every row of its table."""

import asyncio

import pytest

from preview.state.lifecycle import LONGEST_RETRY_S, STEADY_AFTER_S
from preview.supervisor.listener_retry import MOST_RETRIES, ListenerRetry
from tests.support.virtual_time import in_virtual_time


class Listener:
    """One that is opened as soon as it may be."""

    def __init__(self) -> None:
        self._due = asyncio.Event()
        self.retry = ListenerRetry(self._due.set)

    async def opened_after_s(self) -> float:
        """Waits until it may be opened, opens it, and returns how long that took."""
        loop = asyncio.get_running_loop()
        failed_s = loop.time()
        assert self.retry.is_lost
        await self._due.wait()
        self._due.clear()
        assert not self.retry.waits
        self.retry.replaced()
        return loop.time() - failed_s

    def fails(self, *, running: bool = True, recorded: bool = False) -> bool:
        return self.retry.failed(running=running, recorded=recorded)


@in_virtual_time
async def test_after_a_steady_run_it_is_opened_at_once() -> None:
    listener = Listener()
    for _ in range(2 * MOST_RETRIES):
        listener.retry.serves()
        await asyncio.sleep(STEADY_AFTER_S + 1)
        assert listener.fails()
        assert await listener.opened_after_s() == pytest.approx(0.0)


@in_virtual_time
async def test_sooner_it_is_opened_with_growing_pauses_until_the_pipeline_fails() -> None:
    listener = Listener()
    listener.retry.serves()
    pauses_s = []
    while listener.fails():
        pauses_s.append(round(await listener.opened_after_s()))
    assert pauses_s == [1, 2, 4]
    assert not listener.retry.is_lost


@in_virtual_time
async def test_for_a_recording_the_pipeline_always_goes_on() -> None:
    listener = Listener()
    assert not listener.fails(running=False)
    pauses_s = []
    for _ in range(7):
        assert listener.fails(running=False, recorded=True)
        pauses_s.append(round(await listener.opened_after_s()))
    assert pauses_s == [1, 2, 4, 8, 16, LONGEST_RETRY_S, LONGEST_RETRY_S]


@in_virtual_time
async def test_a_request_ends_the_pause_and_counts_anew() -> None:
    listener = Listener()
    for _ in range(MOST_RETRIES):
        assert listener.fails()
        listener.retry.reset()
        assert await listener.opened_after_s() == pytest.approx(0.0)
    assert listener.fails()
    assert await listener.opened_after_s() == pytest.approx(1.0)
