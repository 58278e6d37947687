"""WatchSystemStatus over real connections: at once, on change, at the asked pace, and never a backlog."""

import asyncio
import time
from collections.abc import AsyncIterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import grpc
import pytest

from omniseer.gateway.v1.robot_gateway_pb2 import WatchSystemStatusRequest
from tests.support.eventually import eventually
from tests.support.preview_double import PreviewDouble, serve_double
from tests.support.running_gateway import Operator, running_gateway

# On a busy machine everything takes longer; what is asserted below are orders and counts.
WITHIN_S = 20.0


@pytest.fixture
async def operator(tmp_path: Path) -> AsyncIterator[Operator]:
    server = await serve_double(tmp_path / "preview.sock", PreviewDouble())
    # A computer that is not looked at changes nothing.
    async with running_gateway(tmp_path / "preview.sock", platform={"interval_ms": 600_000}) as operator:
        await eventually(operator.status, lambda it: it.preview.service_reachable, "they have met")
        yield operator
    await server.stop(None)


def watching(operator: Operator, min_interval_ms: int = 0) -> Any:
    return operator.stub.WatchSystemStatus(WatchSystemStatusRequest(min_interval_ms=min_interval_ms))


async def take(call: Any) -> Any:
    async with asyncio.timeout(WITHIN_S):
        return await call.read()


async def test_the_first_status_comes_at_once_and_the_next_when_something_changes(operator: Operator) -> None:
    call = watching(operator)
    first = await take(call)
    assert first.status.gateway_name
    assert abs(first.monotonic_ns - time.monotonic_ns()) < WITHIN_S * 1e9
    switching = asyncio.create_task(operator.switch(True))
    while not (await take(call)).status.preview.endpoint.uri:
        pass
    await switching
    call.cancel()


def reports_that_the_computer_is_stale(status: Any) -> bool:
    return any(fault.id == "platform.stale" and fault.active for fault in status.faults)


async def test_an_unchanged_status_is_sent_once_a_second_with_its_age(operator: Operator) -> None:
    # The last thing that changes here: what is never read again about the computer grows stale.
    await eventually(operator.status, reports_that_the_computer_is_stale, "the last change")
    call = watching(operator)
    instants = [(await take(call)).monotonic_ns for _ in range(5)]
    # The first interval begins between two ticks.
    between_s = [(later - earlier) / 1e9 for earlier, later in pairwise(instants)][1:]
    assert all(each > 0.9 for each in between_s), between_s
    call.cancel()


async def test_no_stream_is_faster_than_requested(operator: Operator) -> None:
    call = watching(operator, min_interval_ms=300)
    instants = [(await take(call)).monotonic_ns]
    stop = asyncio.Event()

    async def change_all_the_time() -> None:
        enabled = False
        while not stop.is_set():
            enabled = not enabled
            await operator.switch(enabled)

    changing = asyncio.create_task(change_all_the_time())
    while len(instants) < 8:
        instants.append((await take(call)).monotonic_ns)
    stop.set()
    await changing
    between_s = [(later - earlier) / 1e9 for earlier, later in pairwise(instants)]
    # The first interval begins between two ticks.
    assert all(each > 0.24 for each in between_s[1:]), between_s
    call.cancel()


async def test_an_interval_beyond_the_schemas_bound_is_refused(operator: Operator) -> None:
    with pytest.raises(grpc.aio.AioRpcError) as seen:
        await take(watching(operator, min_interval_ms=60_001))
    assert seen.value.code() is grpc.StatusCode.INVALID_ARGUMENT
    assert "min_interval_ms" in (seen.value.details() or "")


@pytest.mark.timed
async def test_who_does_not_read_is_not_written_for(operator: Operator) -> None:
    """What waits for a stalled reader is bounded by its connection, and what comes after is the newest."""
    options = (("grpc.use_local_subchannel_pool", 1), ("grpc.http2.bdp_probe", 0))
    async with grpc.aio.insecure_channel(f"127.0.0.1:{operator.port}", options=options) as channel:
        stalled = Operator(channel, operator.port)
        call = watching(stalled)
        await take(call)
        enabled = False
        for _ in range(40):
            enabled = not enabled
            await operator.switch(enabled)
            await asyncio.sleep(0.05)
        # The window of a stream is 64 KiB: some dozens of statuses, however long they are not read.
        held_up = 0
        while (time.monotonic_ns() - (await take(call)).monotonic_ns) / 1e9 > 0.5:
            held_up += 1
        assert held_up < 100
        newest = await take(call)
        assert time.monotonic_ns() - newest.monotonic_ns < 2e9
        call.cancel()


async def test_watchers_leave_nothing_behind(operator: Operator) -> None:
    async def tasks() -> int:
        # The gateway lives in this very loop: its streams, and what waits for changes on their behalf.
        return len(asyncio.all_tasks())

    async def served() -> int:
        return int((await operator.status()).gateway.requests_served)

    served_before, tasks_before = await served(), await tasks()
    calls = [watching(operator) for _ in range(10)]
    for call in calls:
        await take(call)
    assert await tasks() >= tasks_before + 10
    for call in calls:
        call.cancel()
    await eventually(tasks, lambda count: count <= tasks_before, "no stream is served any more")
    # Counted when it ends; a status may have been made a moment before that.
    await eventually(served, lambda count: count >= served_before + 10, "each was counted")
