"""The progress of a copy to the fleet's store, as far as the robot says."""

import asyncio
from collections.abc import AsyncGenerator
from dataclasses import replace
from typing import Any

import pytest

from console.client import Outage, Unreachable
from console.client.errors import Refused
from console.client.mapping.methods import GET_RECORDING, WATCH_SYSTEM_STATUS
from console.client.results import CloudState, RecordingCopy, RecordingCopyState
from console.client.uploading import UploadProgress, upload_progress
from omniseer.gateway.v1.recording_pb2 import GetRecordingResponse
from omniseer.gateway.v1.robot_gateway_pb2 import WatchSystemStatusResponse
from tests.support.filled import fill

State = RecordingCopyState


def _filled(message: Any) -> bytes:
    fill(message)
    data: bytes = message.SerializeToString()
    return data


STATUS = WATCH_SYSTEM_STATUS.decode(_filled(WatchSystemStatusResponse()))
RECORDING = replace(GET_RECORDING.decode(_filled(GetRecordingResponse())).recording, id="a", size=1000)
GONE = Unreachable("gone")


def copy(state: State, done: int = 0, reason: str = "") -> RecordingCopy:
    return RecordingCopy(state=state, reason=reason, bytes_done=done)


class Robot:
    """Answers each look with the next item: a copy, an error, or an outage."""

    def __init__(self, *items: Any, **cloud: Any) -> None:
        self.items = items
        assert STATUS.status.cloud
        values: dict[str, Any] = {"state": CloudState.CONNECTED, "uploading_id": "", "uploads_paused": ""}
        self.watched = replace(
            STATUS, status=replace(STATUS.status, cloud=replace(STATUS.status.cloud, **(values | cloud)))
        )
        self.next: Any = None

    async def watch_status(self, min_interval_s: float = 0.1) -> AsyncGenerator[Any]:
        assert min_interval_s == 1.0, "one look a second is enough"
        for item in self.items:
            self.next = item
            yield item if isinstance(item, Outage) else self.watched
        await asyncio.Event().wait()

    async def recording(self, recording_id: str) -> Any:
        assert recording_id == "a"
        if isinstance(self.next, Exception):
            raise self.next
        return replace(RECORDING, copy=self.next)


async def followed(*items: Any, **cloud: Any) -> list[UploadProgress]:
    async with asyncio.timeout(5):
        return [each async for each in upload_progress(Robot(*items, **cloud), "a")]


async def test_it_ends_when_the_copy_is_verified() -> None:
    found = await followed(copy(State.QUEUED), copy(State.UPLOADING, 340), copy(State.VERIFIED, 1000))
    assert [(each.copy.state, each.copy.bytes_done) for each in found] == [
        (State.QUEUED, 0),
        (State.UPLOADING, 340),
        (State.VERIFIED, 1000),
    ]
    assert found[-1].size == 1000


async def test_what_the_bridge_copies_now_is_newer_than_what_the_recorder_has() -> None:
    now = copy(State.UPLOADING, 500)
    first, *_ = [
        each
        for each in await followed(copy(State.UPLOADING, 1), copy(State.VERIFIED), uploading=now)
        if each.copy.state is State.UPLOADING
    ]
    assert first.copy.bytes_done == 1, "it copies another one"

    async def one() -> UploadProgress:
        robot = Robot(copy(State.UPLOADING, 1), uploading=now, uploading_id="a", upload_bytes_per_s=7)
        return await anext(upload_progress(robot, "a"))

    progress = await one()
    assert (progress.copy.bytes_done, progress.bytes_per_s) == (500, 7)


async def test_why_it_waits() -> None:
    failed = copy(State.FAILED, reason="the store is full")
    end = copy(State.VERIFIED)
    assert (await followed(failed, end))[0].waiting == "the store is full"
    assert (await followed(copy(State.QUEUED), end, uploads_paused="at night"))[0].waiting == "at night"
    away: dict[str, Any] = {"state": CloudState.OFFLINE, "last_error": "no route"}
    assert (await followed(copy(State.QUEUED), end, **away))[0].waiting == "no route"
    assert (
        "unreachable"
        in (await followed(copy(State.QUEUED), end, state=CloudState.UNREACHABLE, last_error=""))[0].waiting
    )


async def test_an_outage_is_waited_for() -> None:
    outage = Outage(GONE, 1)
    found = await followed(copy(State.UPLOADING, 340), outage, GONE, copy(State.VERIFIED, 1000))
    assert [each.copy.bytes_done for each in found] == [340, 340, 1000]
    assert found[1].waiting == "no connection to the robot"


async def test_a_copy_that_is_cancelled_ends_it_and_a_slow_recorder_does_not() -> None:
    none = copy(State.UNKNOWN)
    assert len(await followed(none, none, copy(State.QUEUED), none, copy(State.VERIFIED))) == 2
    found = await followed(copy(State.QUEUED), *[none] * 10)
    assert [each.copy.state for each in found] == [State.QUEUED, State.UNKNOWN]


async def test_a_recording_that_is_deleted_is_an_error() -> None:
    with pytest.raises(Refused):
        await followed(copy(State.QUEUED), Refused("there is no such recording"))
