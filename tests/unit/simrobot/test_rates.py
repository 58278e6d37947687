import asyncio
import time

import pytest

from simrobot.rates import call_at_rate


async def test_calls_do_not_drift() -> None:
    """A call that takes part of the period does not make the next one late."""
    moments: list[float] = []
    enough = asyncio.Event()

    def action() -> None:
        moments.append(time.monotonic())
        while time.monotonic() - moments[-1] < 0.005:
            pass
        if len(moments) == 21:
            enough.set()

    task = asyncio.create_task(call_at_rate(50.0, action))
    await asyncio.wait_for(enough.wait(), 20)
    task.cancel()
    # 20 periods of 20 ms; a pause of one period after each call would need 500 ms.
    whole_periods = (moments[20] - moments[0]) / 0.02
    assert abs(whole_periods - round(whole_periods)) < 0.45


async def test_an_exception_of_the_action_propagates() -> None:
    def action() -> None:
        raise RuntimeError("no publisher")

    with pytest.raises(RuntimeError, match="no publisher"):
        await call_at_rate(10.0, action)
