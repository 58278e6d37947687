"""The watched status: what wakes a watcher, with detections and without."""

import asyncio
import time
from collections.abc import AsyncIterator
from itertools import pairwise
from typing import Any

import pytest

from gateway.rpc.calls.recipient import Recipient
from gateway.rpc.responses.status_stream import StatusStream
from gateway.status.board import Board
from gateway.status.preview import Counters, PreviewState, PreviewView
from gateway.status.snapshot import Identity, Programs, Rules, Setup, Snapshot, SourceRule, take
from gateway.status.sources import DETECTIONS, ODOMETRY
from gateway.status.values import Detection, Detections, Received, Velocity
from gateway.status.watch_pacing import TICK_MS
from omniseer.gateway.v1.robot_gateway_pb2 import WatchSystemStatusResponse
from tests.support.virtual_time import VirtualTimeLoop, in_virtual_time

CALLER = Recipient("10.0.0.1", sees_passphrase=False)
PREVIEW = PreviewView(PreviewState.DISABLED, None, "", True, None, None, None, None, Counters())
CUP = Detection(41, "cup", 0.9, "7", 10, 20, 30, 40)
QUIET_S = 0.3
"""Several ticks, and less than the heartbeat."""
INTERVAL_MS = 300


class World:
    """A board that the test writes on."""

    def __init__(self) -> None:
        self.board = Board()
        self.taken = 0
        self.now_s = time.monotonic()
        """Stands still, so that no age differs between two answers."""
        # Far from stale: nothing changes unless a test changes it.
        self._rules = Rules(
            {DETECTIONS: SourceRule(60_000, False), ODOMETRY: SourceRule(60_000, False)}, 60_000
        )

    def snapshot(self) -> Snapshot:
        self.taken += 1
        setup = Setup(Identity("lab", "1", insecure=False), self._rules)
        return take(setup, self.board, Programs(PREVIEW), self.now_s)

    def see(self, *items: Detection) -> None:
        self.board[DETECTIONS] = Received(Detections(1280, 720, len(items), items), self.now_s)


@pytest.fixture
async def stream() -> AsyncIterator[tuple[World, StatusStream]]:
    world = World()
    world.see(CUP)
    stream = StatusStream(world, time.monotonic)
    ticking = asyncio.create_task(stream.run())
    yield world, stream
    ticking.cancel()


async def read(responses: AsyncIterator[bytes], within_s: float = 5.0) -> WatchSystemStatusResponse:
    async with asyncio.timeout(within_s):
        return WatchSystemStatusResponse.FromString(await anext(responses))


async def test_detections_come_on_request_from_the_same_instant(stream: tuple[World, StatusStream]) -> None:
    _, watch = stream
    plain = await read(watch.responses(0, CALLER))
    assert not plain.HasField("detections")
    full = await read(watch.responses(0, CALLER, with_detections=True))
    assert [each.class_name for each in full.detections.detections] == ["cup"]
    assert full.detections.available
    assert full.status == plain.status


async def test_new_detections_wake_those_who_requested_them_and_no_others(
    stream: tuple[World, StatusStream],
) -> None:
    world, watch = stream
    plain, full = watch.responses(0, CALLER), watch.responses(0, CALLER, with_detections=True)
    await read(plain)
    await read(full)
    waiting: asyncio.Task[Any] = asyncio.create_task(read(plain))
    world.see(CUP, CUP)
    assert (await read(full, QUIET_S)).detections.detection_count == 2
    assert not waiting.done(), "a status without detections has not changed"
    world.board[ODOMETRY] = Received(Velocity(0.1, 0.0, 0.0), time.monotonic())
    assert (await waiting).status.health.measured_vx_mps == pytest.approx(0.1)
    assert (await read(full)).status.health.measured_vx_mps == pytest.approx(0.1)


async def test_no_snapshot_is_taken_while_no_response_can_be_due(stream: tuple[World, StatusStream]) -> None:
    world, watch = stream
    slow = watch.responses(60_000, CALLER)
    await read(slow)
    taken = world.taken
    with pytest.raises(TimeoutError):
        await read(slow, QUIET_S)
    assert world.taken == taken


async def test_before_the_first_detections_the_field_says_that_there_are_none() -> None:
    watch = StatusStream(World(), time.monotonic)
    response = await read(watch.responses(0, CALLER, with_detections=True))
    assert response.HasField("detections")
    assert not response.detections.available


class Moving(World):
    """Another velocity in each snapshot, dated by the clock of the loop; one is followed by a stall."""

    def __init__(self, held_up_after: int, stall_s: float) -> None:
        super().__init__()
        self._held_up_after = held_up_after
        self._stall_s = stall_s

    def snapshot(self) -> Snapshot:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualTimeLoop)
        self.now_s = loop.time()
        self.board[ODOMETRY] = Received(Velocity(self.taken / 10, 0.0, 0.0), self.now_s)
        taken = super().snapshot()
        if self.taken == self._held_up_after:
            loop.call_soon(loop.spend, self._stall_s)
        return taken


@pytest.mark.parametrize("stall_ms", range(5, 400, 30))
@pytest.mark.parametrize("before_ms", [0, 20, 40])
@pytest.mark.parametrize("watchers", [1, 3])
@in_virtual_time
async def test_a_loop_that_is_held_up_sends_nothing_sooner(
    watchers: int, before_ms: int, stall_ms: int
) -> None:
    """Before a response comes due, and when it is on its way: the beat may shift by less than one tick."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualTimeLoop)
    watch = StatusStream(Moving(6, stall_ms / 1000), loop.time)
    ticking = asyncio.create_task(watch.run())
    loop.call_at((3 * INTERVAL_MS - before_ms) / 1000, loop.spend, stall_ms / 1000)

    async def times_of_a_watcher() -> list[float]:
        dated_s: list[float] = []
        async for response in watch.responses(INTERVAL_MS, CALLER):
            dated_s.append(WatchSystemStatusResponse.FromString(response).monotonic_ns / 1e9)
            if dated_s[-1] > 3:
                break
        return dated_s

    for dated_s in await asyncio.gather(*(times_of_a_watcher() for _ in range(watchers))):
        # The first interval begins between two ticks.
        between_ms = [1000 * (later - earlier) for earlier, later in pairwise(dated_s)][1:]
        assert min(between_ms) > INTERVAL_MS - TICK_MS - 1
        assert max(between_ms) < INTERVAL_MS + stall_ms + 2 * TICK_MS
    ticking.cancel()
