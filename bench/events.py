"""An event that is raised in the gateway, until the last of 20 subscribers has it.

The event carries the instant at which it was raised, on the clock that all processes of a machine share, so
each subscriber can compute how long it took.
"""

import asyncio
import random
import statistics
import time
from typing import Any

import grpc
import uvloop

from bench.calling import OWN_CONNECTION
from bench.progress import log
from bench.rows import Row
from bench.stack import running_stack
from bench.status_server import RAISE_METHOD
from bench.watch_load import SERVICE
from omniseer.gateway.v1.robot_gateway_pb2 import SubscribeEventsResponse

SUBSCRIBERS = 20
ROUNDS = 5
EVENTS = 100
PAUSE_S = 0.03
GIVE_UP_S = 20.0


def run(names: list[str]) -> list[Row]:
    with running_stack() as stack:
        rounds_ms = [uvloop.run(_latencies_ms(stack.port)) for _ in range(ROUNDS)]
    log(f"events: {sum(len(took_ms) for took_ms in rounds_ms)} deliveries")
    row = Row(
        name="events.p99_ms",
        what=f"event raised until received: 99th percentile of {EVENTS} events at {SUBSCRIBERS} subscribers",
        unit="ms",
        values=[statistics.quantiles(took_ms, n=100)[98] for took_ms in rounds_ms],
        bar=50,
    )
    return [row] if not names or row.name in names else []


async def _latencies_ms(port: int) -> list[float]:
    """Of every delivery; all subscribers must have had every event."""
    took_ms: list[float] = []
    channels = [_channel(port) for _ in range(SUBSCRIBERS + 1)]
    ready = [asyncio.Event() for _ in range(SUBSCRIBERS)]
    try:
        async with asyncio.timeout(GIVE_UP_S + EVENTS * PAUSE_S), asyncio.TaskGroup() as tasks:
            for channel, event in zip(channels, ready, strict=False):
                tasks.create_task(_receive(channel, event, took_ms))
            for event in ready:
                await event.wait()
            await _raise(channels[-1])
    finally:
        for channel in channels:
            await channel.close()
    return took_ms


async def _receive(channel: Any, ready: asyncio.Event, took_ms: list[float]) -> None:
    call = channel.unary_stream(
        f"{SERVICE}/SubscribeEvents", response_deserializer=SubscribeEventsResponse.FromString
    )(b"")
    count = 0
    async for response in call:
        if response.HasField("caught_up"):
            ready.set()
        elif ready.is_set():
            took_ms.append((time.monotonic_ns() - response.event.monotonic_ns) / 1e6)
            count += 1
            if count == EVENTS:
                call.cancel()
                return


async def _raise(channel: Any) -> None:
    dice = random.Random(1)
    call = channel.unary_unary(RAISE_METHOD)
    for _ in range(EVENTS):
        await asyncio.sleep(dice.uniform(0, 2 * PAUSE_S))
        await call(b"")


def _channel(port: int) -> Any:
    return grpc.aio.insecure_channel(f"127.0.0.1:{port}", options=OWN_CONNECTION)
