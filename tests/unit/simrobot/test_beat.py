import asyncio
import time

import pytest

from simrobot.beat import beat


async def test_beats_do_not_drift() -> None:
    """A call that takes part of the period does not make the next one late."""
    moments: list[float] = []
    enough = asyncio.Event()

    def action() -> None:
        moments.append(time.monotonic())
        while time.monotonic() - moments[-1] < 0.005:
            pass
        if len(moments) == 21:
            enough.set()

    task = asyncio.create_task(beat(50.0, action))
    await asyncio.wait_for(enough.wait(), 20)
    task.cancel()
    # 20 periods of 20 ms; a beat that waited a period after each call would need 500 ms.
    whole_periods = (moments[20] - moments[0]) / 0.02
    assert abs(whole_periods - round(whole_periods)) < 0.45


async def test_an_action_that_fails_ends_the_beat() -> None:
    def action() -> None:
        raise RuntimeError("no publisher")

    with pytest.raises(RuntimeError, match="no publisher"):
        await beat(10.0, action)
