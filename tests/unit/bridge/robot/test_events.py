"""What counts as a failure of the gateway's stream of events."""

import asyncio
from typing import Any

from bridge.config import GatewaySettings
from bridge.events.values import Position
from bridge.outbox.errors import OutboxError
from bridge.robot.events import EventReader
from common.tasks import cancel
from tests.support.virtual_time import in_virtual_time


class Refusing:
    """An outbox whose disk takes nothing. `calls` counts them."""

    def __init__(self) -> None:
        self.calls = 0

    async def position(self) -> Position | None:
        self.calls += 1
        raise OutboxError("the disk is full")


@in_virtual_time
async def test_a_full_disk_is_no_failure_of_the_gateway() -> None:
    """The defect: each refusal of the disk counted as one of the gateway, too."""
    refusing = Refusing()
    kept: Any = refusing
    reader = EventReader(GatewaySettings(), kept)
    reading = asyncio.create_task(reader.run())
    await asyncio.sleep(60.0)
    await cancel([reading])
    assert refusing.calls > 2
    assert reader.failures == 0
