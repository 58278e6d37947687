"""A recording is cancelled while a slow disk writes its row."""

import asyncio
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from typing import Any

import pytest

from bridge.uploads.queue import State, Upload
from fleet.errors import HubError, HubReason
from tests.support.eventually import eventually
from tests.support.uploading import Robot, Rows, Running, running_uploads

HUB: Any = None
TICKS_S = 0.3


@dataclass
class SlowRows(Rows):
    """Holds the first row with a state until it is released."""

    holds: State
    held: asyncio.Event = field(default_factory=asyncio.Event)
    released: asyncio.Event = field(default_factory=asyncio.Event)

    def __post_init__(self) -> None:
        super().__init__()

    async def put_upload(self, upload: Upload) -> None:
        if upload.state is self.holds:
            self.held.set()
            await self.released.wait()
        await super().put_upload(upload)


@pytest.fixture
def robot() -> Robot:
    robot = Robot()
    robot.add("one", {"data.bin": b"one"})
    return robot


async def cancel_while_held(running: Running, rows: SlowRows) -> None:
    """Cancels the upload while its row is being written, and gives what follows some ticks' time."""

    async def is_gone() -> bool:
        return not running.uploads.queue.waiting

    await rows.held.wait()
    cancelling = asyncio.create_task(running.uploads.cancel("one"))
    await eventually(is_gone, bool, "it is cancelled")
    rows.released.set()
    await cancelling
    await asyncio.sleep(TICKS_S)
    assert rows.rows["one"].state is State.LOCAL


async def test_one_that_was_about_to_begin_is_not_uploaded(robot: Robot) -> None:
    """The defect: it was all the same, and its end ended the bridge."""
    rows = SlowRows(State.UPLOADING)
    async with asyncio.timeout(20), running_uploads(robot, HUB, "127.0.0.1:9", (), rows) as running:
        await running.uploads.enqueue("one")
        await cancel_while_held(running, rows)
        assert not robot.opened


async def test_one_that_was_to_be_tried_again_is_not(robot: Robot) -> None:
    """The defect: that ended the bridge."""
    rows = SlowRows(State.QUEUED)
    rows.released.set()
    async with asyncio.timeout(20), running_uploads(robot, NoReceiver(), "127.0.0.1:9", (), rows) as running:
        await running.uploads.enqueue("one")
        await running.until("one", lambda each: each and each.state is State.FAILED)
        rows.held.clear()
        rows.released.clear()
        await cancel_while_held(running, rows)


class NoReceiver:
    """A hub at which no receiver runs."""

    async def request(self, _subject: str, _payload: bytes, _timeout_s: float, /) -> bytes:
        raise HubError(HubReason.NO_RESPONDERS, "no receiver")

    def request_many(self, _subject: str, _payload: bytes, _silence_s: float, /) -> AsyncIterator[bytes]:
        raise HubError(HubReason.NO_RESPONDERS, "no receiver")
