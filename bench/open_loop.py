"""GetSystemStatus at the rate at which operators call: eight of them, ten times a second each.

The real programs with their default limits, TLS, and a login for each caller. Calls leave at their time
whether or not the one before was answered, and the wait counts from then on, so that a slow answer does not
hide the ones behind it. The reference is the health service's Check on the same connections: half a period
later for the latency, in turns for the CPU.
"""

import asyncio
import random
import statistics
import tempfile
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import grpc
import uvloop
from grpc_health.v1 import health_pb2, health_pb2_grpc

from bench.calling import OWN_CONNECTION, Call, authorization, call
from bench.processes import cpu_seconds
from bench.product import Product, product
from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row
from console.client import Credentials
from gateway.access.credential_admin import CredentialAdmin, CredentialRequest
from gateway.access.directory import CredentialDirectory
from gateway.access.login_bundle import LoginBundle
from gateway.access.role import Role
from omniseer.gateway.v1.robot_gateway_pb2 import GetSystemStatusRequest
from omniseer.gateway.v1.robot_gateway_pb2_grpc import RobotGatewayStub

CALLERS: Final = 8
PERIOD_S: Final = 0.1
ROUND_S: Final = 10.0
_HOST: Final = "127.0.0.1"
_CALLERS_TEXT: Final = f"{CALLERS} callers at {1 / PERIOD_S:.0f} Hz over TLS, default limits"


@dataclass(frozen=True, slots=True)
class Callers:
    """Calls of all callers, of two methods, on connections of their own.

    Args:
        status: GetSystemStatus.
        check: the health service's Check.
    """

    status: list[Call]
    check: list[Call]


def p99_row() -> Row:
    """Returns status.p99."""
    with guarded_robot() as (running, bundles):
        ours_ms, reference_ms = uvloop.run(_latencies_ms(running.target, bundles))
    return Row(
        name="status.p99",
        what=f"GetSystemStatus, {_CALLERS_TEXT}: 99th percentile from due to answered, against the health"
        " service's Check",
        unit="ms",
        values=ours_ms,
        references=reference_ms,
        bar=1.3,
    )


def cpu_row() -> Row:
    """Returns status.cpu_per_call_real."""
    with guarded_robot() as (running, bundles):
        ours_us, reference_us = uvloop.run(_costs_us(running.target, running.gateway.pid, bundles))
    return Row(
        name="status.cpu_per_call_real",
        what=f"GetSystemStatus, {_CALLERS_TEXT}: CPU of robot-gateway for each call beyond what it needs"
        " without calls, against the health service's Check",
        unit="us",
        values=ours_us,
        references=reference_us,
        bar=None,
    )


@contextmanager
def guarded_robot() -> Iterator[tuple[Product, list[LoginBundle]]]:
    """Runs the product with a login for each caller until the block ends."""
    with tempfile.TemporaryDirectory() as directory:
        admin = CredentialAdmin(CredentialDirectory(Path(directory) / "credentials"), "bench")
        admin.initialize((_HOST,))
        bundles = [
            admin.add(CredentialRequest(f"caller-{number}", Role.VIEWER))[1] for number in range(CALLERS)
        ]
        security = {"credentials": str(Path(directory) / "credentials")}
        first = Credentials(ca_certificate=bundles[0].ca_certificate, token=bundles[0].token)
        with product(Path(directory), {"security": security}, first) as running:
            yield running, bundles


@asynccontextmanager
async def callers(target: str, bundles: list[LoginBundle]) -> AsyncIterator[Callers]:
    """Connects all callers until the block ends; each has called once."""
    credentials = grpc.ssl_channel_credentials(bundles[0].ca_certificate)
    channels = [grpc.aio.secure_channel(target, credentials, options=OWN_CONNECTION) for _ in bundles]
    health: Any = health_pb2_grpc.HealthStub
    made = Callers(
        [
            call(RobotGatewayStub(channel).GetSystemStatus, GetSystemStatusRequest(), authorization(bundle))
            for channel, bundle in zip(channels, bundles, strict=True)
        ],
        [
            call(health(channel).Check, health_pb2.HealthCheckRequest(), authorization(bundle))
            for channel, bundle in zip(channels, bundles, strict=True)
        ],
    )
    try:
        await asyncio.gather(*(each() for each in (*made.status, *made.check)))
        yield made
    finally:
        for channel in channels:
            await channel.close()


async def _latencies_ms(target: str, bundles: list[LoginBundle]) -> tuple[list[float], list[float]]:
    """Returns the 99th percentiles of both methods, which are called at once."""
    ours_ms, reference_ms = [], []
    async with callers(target, bundles) as calls:
        for number in range(FEWEST_ROUNDS):
            found = await asyncio.gather(_round(calls.status, 0.0), _round(calls.check, PERIOD_S / 2))
            ours, reference = (statistics.quantiles(took_s, n=100)[98] * 1000 for took_s in found)
            ours_ms.append(ours)
            reference_ms.append(reference)
            log(f"status.p99: round {number + 1}, {ours:.2f} ms against {reference:.2f} ms")
    return ours_ms, reference_ms


async def _costs_us(target: str, pid: int, bundles: list[LoginBundle]) -> tuple[list[float], list[float]]:
    """Returns the CPU time for each call of both methods, which are called in turns."""
    ours_us, reference_us = [], []
    async with callers(target, bundles) as calls:
        for number in range(FEWEST_ROUNDS):
            idle = await _idle_share(pid)
            ours = await _cost_us(pid, calls.status, idle)
            reference = await _cost_us(pid, calls.check, idle)
            ours_us.append(ours)
            reference_us.append(reference)
            log(
                f"status.cpu_per_call_real: round {number + 1}, {ours:.0f} us against {reference:.0f} us,"
                f" {idle:.2%} of a core without calls"
            )
    return ours_us, reference_us


async def _idle_share(pid: int) -> float:
    """Returns the share of a core that a process needs without calls."""
    before_s, began_s = cpu_seconds(pid), time.perf_counter()
    await asyncio.sleep(ROUND_S)
    return (cpu_seconds(pid) - before_s) / (time.perf_counter() - began_s)


async def _cost_us(pid: int, calls: list[Call], idle: float) -> float:
    """Returns the CPU time for each call of a round, beyond what the process needs without calls."""
    before_s, began_s = cpu_seconds(pid), time.perf_counter()
    took_s = await _round(calls, 0.0)
    spent_s = cpu_seconds(pid) - before_s - idle * (time.perf_counter() - began_s)
    return spent_s / len(took_s) * 1e6


async def _round(calls: list[Call], shift_s: float) -> list[float]:
    """Returns how long each answer of a round took, by all callers."""
    begin_s = time.perf_counter() + PERIOD_S + shift_s
    phases_s = [random.Random(number).uniform(0, PERIOD_S) for number in range(len(calls))]
    found = await asyncio.gather(
        *(_caller(each, begin_s + phase_s) for each, phase_s in zip(calls, phases_s, strict=True))
    )
    return [took_s for caller in found for took_s in caller]


async def _caller(each: Call, begin_s: float) -> list[float]:
    """Returns how long each answer took from the moment at which its call was due."""
    took_s: list[float] = []

    async def once(due_s: float) -> None:
        await each()
        took_s.append(time.perf_counter() - due_s)

    async with asyncio.TaskGroup() as pending:
        for number in range(round(ROUND_S / PERIOD_S)):
            due_s = begin_s + number * PERIOD_S
            await asyncio.sleep(max(0.0, due_s - time.perf_counter()))
            pending.create_task(once(due_s))
    return took_s
