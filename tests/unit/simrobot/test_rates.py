"""Calls at a rate, in virtual time: the load of the machine that runs the tests makes none of them late."""

import asyncio
from collections.abc import Iterable
from itertools import repeat

import pytest

from simrobot.rates import call_at_rate
from tests.support.virtual_time import VirtualTimeLoop, in_virtual_time


class Calls:
    """Records when it is called, in virtual time, and takes a while each time.

    Args:
        take_s: how long the first calls take; those after them take no time.
    """

    def __init__(self, take_s: Iterable[float]) -> None:
        self.moments: list[float] = []
        self._take_s = iter(take_s)

    def __call__(self) -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualTimeLoop)
        self.moments.append(loop.time())
        loop.spend(next(self._take_s, 0.0))


async def moments_at_50_hz(calls: Calls, until_s: float) -> list[float]:
    task = asyncio.create_task(call_at_rate(50.0, calls))
    await asyncio.sleep(until_s)
    task.cancel()
    return calls.moments


@in_virtual_time
async def test_calls_do_not_drift() -> None:
    """A call that takes part of the period does not make the next one late."""
    moments = await moments_at_50_hz(Calls(repeat(0.005)), until_s=0.41)
    assert moments == pytest.approx([number * 0.02 for number in range(21)])


@in_virtual_time
async def test_periods_that_pass_during_a_call_are_skipped() -> None:
    """A first call of 2.5 periods is followed by one late call, and then by those that are due."""
    moments = await moments_at_50_hz(Calls([0.05]), until_s=0.11)
    assert moments == pytest.approx([0, 0.05, 0.06, 0.08, 0.1])


async def test_an_exception_of_the_action_propagates() -> None:
    def action() -> None:
        raise RuntimeError("no publisher")

    with pytest.raises(RuntimeError, match="no publisher"):
        await call_at_rate(10.0, action)
