"""GetSystemStatus with everything filled, against an empty method of the same server, 8 clients at once.

Both are called in turns, in short rounds, so that a machine that is busy with something else for a while is
so for both; the median round speaks.
"""

import asyncio
import statistics
import sys
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any

import grpc
import uvloop

from bench.rows import Row
from bench.stack import running_stack
from bench.status_server import EMPTY_METHOD
from omniseer.gateway.v1.robot_gateway_pb2 import GetSystemStatusRequest
from omniseer.gateway.v1.robot_gateway_pb2_grpc import RobotGatewayStub

CLIENTS = 8
ROUNDS = 9
ROUND_S = 1.0

Call = Callable[[], Awaitable[Any]]


@dataclass(frozen=True)
class Round:
    """What one round of one method came to."""

    calls_per_s: float
    p99_ms: float


def run(names: list[str]) -> list[Row]:
    with running_stack() as stack:
        empty, status = uvloop.run(_measure(stack.port))
    rows = [
        Row(
            name="status.throughput",
            what=f"GetSystemStatus against an empty method, {CLIENTS} clients",
            unit="calls/s",
            value=statistics.median(each.calls_per_s for each in status),
            reference=statistics.median(each.calls_per_s for each in empty),
            bar=0.85,
            better="higher",
        ),
        Row(
            name="status.p99",
            what=f"the same calls: 99th percentile of the time each took, {CLIENTS} clients",
            unit="ms",
            value=statistics.median(each.p99_ms for each in status),
            reference=statistics.median(each.p99_ms for each in empty),
            bar=1.3,
        ),
    ]
    return [row for row in rows if not names or row.name in names]


async def _measure(port: int) -> tuple[list[Round], list[Round]]:
    channels = [
        # A client each: by default gRPC would let equal channels share one connection.
        grpc.aio.insecure_channel(f"127.0.0.1:{port}", options=(("grpc.use_local_subchannel_pool", 1),))
        for _ in range(CLIENTS)
    ]
    empty_calls = [_calling(channel.unary_unary(EMPTY_METHOD), b"") for channel in channels]
    request = GetSystemStatusRequest()
    status_calls = [_calling(RobotGatewayStub(channel).GetSystemStatus, request) for channel in channels]
    try:
        await _round(empty_calls)
        await _round(status_calls)
        empty, status = [], []
        for number in range(ROUNDS):
            empty.append(await _round(empty_calls))
            status.append(await _round(status_calls))
            print(f"status: round {number + 1} of {ROUNDS}", file=sys.stderr)
        return empty, status
    finally:
        for channel in channels:
            await channel.close()


def _calling(method: Any, request: Any) -> Call:
    return lambda: method(request)


async def _round(calls: list[Call]) -> Round:
    """Every client calls again as soon as it has its answer."""
    took_s: list[float] = []
    begin = time.perf_counter()
    end = begin + ROUND_S

    async def client(call: Call) -> None:
        while (sent := time.perf_counter()) < end:
            await call()
            took_s.append(time.perf_counter() - sent)

    await asyncio.gather(*(client(call) for call in calls))
    return Round(
        calls_per_s=len(took_s) / (time.perf_counter() - begin),
        p99_ms=statistics.quantiles(took_s, n=100)[98] * 1000,
    )
