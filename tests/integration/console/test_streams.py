"""Both clients' streams against a real gateway, over links that break and gateways that end."""

import asyncio
import threading
import time
from collections.abc import Iterator
from contextlib import aclosing
from typing import Any

import pytest

from console.client import (
    AsyncGatewayClient,
    Cancelled,
    CaughtUp,
    Event,
    GatewayClient,
    Outage,
    Unreachable,
    WatchedStatus,
)
from console.client.options import Backoff, ClientOptions
from tests.support.bad_links import Relay
from tests.support.gateway_double import GatewayDouble, serving
from tests.support.gateway_program import GatewayProgram, gateway_program
from tests.support.own_connections import all_closed, nothing_collected, own_connections
from tests.support.waiting import wait_until

QUICK = ClientOptions(stream_backoff=Backoff(first_s=0.02, longest_s=0.1))


@pytest.fixture(scope="module")
def gateway(tmp_path_factory: pytest.TempPathFactory) -> Iterator[GatewayProgram]:
    with gateway_program(tmp_path_factory.mktemp("gateway"), sources=[]) as program:
        yield program


def next_status(stream: Any) -> WatchedStatus:
    return next(item for item in stream if isinstance(item, WatchedStatus))


def test_a_broken_link_is_reported_and_restored(gateway: GatewayProgram) -> None:
    with Relay(gateway.port) as relay, GatewayClient(f"127.0.0.1:{relay.port}", QUICK) as client:
        stream = client.watch_status()
        next_status(stream)
        relay.cut()
        items = iter(stream)
        outage = next(item for item in items if isinstance(item, Outage))
        assert isinstance(outage.error, Unreachable)
        assert next_status(items).status.gateway_name
        assert client.reconnects >= 1


def test_who_reads_slowly_gets_the_newest(gateway: GatewayProgram) -> None:
    with GatewayClient(f"127.0.0.1:{gateway.port}") as client:
        stream = client.watch_status()
        next_status(stream)
        # The gateway sends its status once a second at least: five come, and only the last is kept.
        waiting = threading.Event()
        waiting.wait(5.5)
        late, read_ns = next_status(stream), time.monotonic_ns()
        newer = next_status(stream)
        assert late.monotonic_ns is not None
        assert newer.monotonic_ns is not None
        assert (read_ns - late.monotonic_ns) / 1e9 < 3, "not the first of those that came"


def test_an_absent_robot_is_known_soon() -> None:
    with Relay(1) as relay:  # a port that was taken and is now free again
        port = relay.port
    began_s = time.monotonic()
    with GatewayClient(f"127.0.0.1:{port}") as client, pytest.raises(Unreachable):
        next(client.watch_status())
    assert time.monotonic() - began_s < 10


def test_closing_the_client_ends_its_streams(gateway: GatewayProgram) -> None:
    client = GatewayClient(f"127.0.0.1:{gateway.port}")
    stream = client.events()
    assert any(isinstance(item, CaughtUp) for item in stream)
    closing = threading.Timer(0.2, client.close)
    closing.start()
    with pytest.raises(Cancelled):
        for _ in stream:
            pass
    closing.join()


def test_a_stream_that_is_not_read_any_more_ends_on_the_robot(gateway: GatewayProgram) -> None:
    with GatewayClient(f"127.0.0.1:{gateway.port}") as client:
        stream = client.watch_status()
        next_status(stream)
        assert tasks_of(client) == 1
        stream.close()  # type: ignore[attr-defined]  # it is a generator
        wait_until(lambda: tasks_of(client) == 0, "the stream's task has ended")
    assert not any(thread.name == "gateway-client" for thread in threading.enumerate())


def tasks_of(client: GatewayClient) -> int:
    """How many streams the client receives."""
    loop = client._loop._loop
    return sum(task.get_name() == "gateway-stream" for task in asyncio.all_tasks(loop))


async def test_the_asyncio_client_does_the_same(gateway: GatewayProgram) -> None:
    with Relay(gateway.port) as relay:
        async with AsyncGatewayClient(f"127.0.0.1:{relay.port}", QUICK) as client, asyncio.timeout(30):
            stream = client.watch_status()
            assert isinstance(await anext(stream), WatchedStatus)
            relay.cut()
            while not isinstance(await anext(stream), Outage):
                pass
            while not isinstance(await anext(stream), WatchedStatus):
                pass
            events = client.events()
            first = await anext(events)
            assert isinstance(first, Event | CaughtUp)
    assert client.reconnects >= 1


async def test_closing_the_asyncio_client_ends_its_streams(gateway: GatewayProgram) -> None:
    client = AsyncGatewayClient(f"127.0.0.1:{gateway.port}")

    async def read() -> None:
        async for _ in client.events():
            began.set()

    began = asyncio.Event()
    reading = asyncio.create_task(read())
    async with asyncio.timeout(20):
        await began.wait()
        await client.close()
        with pytest.raises(Cancelled):
            await reading


@pytest.mark.parametrize("stream", ["watch_status", "events"])
async def test_a_client_that_is_closed_leaves_no_connection(gateway: GatewayProgram, stream: str) -> None:
    with nothing_collected():
        before = own_connections(gateway.port)
        async with AsyncGatewayClient(f"127.0.0.1:{gateway.port}") as client:
            async with aclosing(getattr(client, stream)()) as items:
                await anext(items)
            opened = own_connections(gateway.port) - before
        assert opened
        await all_closed(gateway.port, opened)


async def test_the_robots_clock_is_known_within_its_bound(gateway: GatewayProgram) -> None:
    async with AsyncGatewayClient(f"127.0.0.1:{gateway.port}") as client:
        offsets = [await client.ping() for _ in range(5)]
    best = min(offsets, key=lambda offset: offset.error_s)
    # Both run on one machine: the actual offset is zero.
    assert abs(best.seconds) <= best.error_s + 1e-6


def test_an_older_gateway_is_polled() -> None:
    double = GatewayDouble()
    with serving(double) as port, GatewayClient(f"127.0.0.1:{port}") as client:
        stream = client.watch_status(0.05)
        polled = [next_status(stream) for _ in range(3)]
    assert [each.monotonic_ns for each in polled] == [None] * 3
    assert double.calls.count("GetSystemStatus") >= 3


async def test_detections_come_with_the_status_on_request(gateway: GatewayProgram) -> None:
    async with AsyncGatewayClient(f"127.0.0.1:{gateway.port}") as client, asyncio.timeout(20):
        requested = await anext(client.watch_status(include_detections=True))
        plain = await anext(client.watch_status())
    assert isinstance(requested, WatchedStatus)
    assert requested.detections is not None
    assert not requested.detections.available, "no source is configured"
    assert isinstance(plain, WatchedStatus)
    assert plain.detections is None
