"""A stream of states without a queue."""

import asyncio
from contextlib import aclosing

import pytest

from common.broadcast import Broadcast


async def test_now_then_on_each_notification() -> None:
    changes = Broadcast()
    async with aclosing(changes.now_and_on_change(lambda: 60.0)) as turns:
        await anext(turns)
        waiting = asyncio.ensure_future(anext(turns))
        done, _ = await asyncio.wait((waiting,), timeout=0.05)
        assert not done, "nothing has changed"
        changes.notify_all()
        await asyncio.wait_for(waiting, 5)


async def test_the_heartbeat_is_asked_for_before_each_wait() -> None:
    heartbeats = iter((0.0, 60.0))
    async with aclosing(Broadcast().now_and_on_change(lambda: next(heartbeats))) as turns:
        await anext(turns)
        await asyncio.wait_for(anext(turns), 5)
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(anext(turns), 0.05)


async def test_a_change_while_a_turn_is_used_is_the_next_turn() -> None:
    """The defect: it waited for the next notification, or the heartbeat."""
    changes = Broadcast()
    async with aclosing(changes.now_and_on_change(lambda: 60.0)) as turns:
        await anext(turns)
        changes.notify_all()
        await asyncio.wait_for(anext(turns), 5)
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(anext(turns), 0.05)
