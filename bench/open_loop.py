"""GetSystemStatus at the rate at which operators call: eight of them, ten times a second each.

The real programs with their default limits, TLS, and a login for each caller. Calls leave at their time
whether or not the one before was answered, and the wait counts from then on, so that a slow answer does not
hide the ones behind it. The reference is the health service's Check on the same connections, half a period
later.
"""

import asyncio
import random
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any, Final

import grpc
import uvloop
from grpc_health.v1 import health_pb2, health_pb2_grpc

from bench.calling import OWN_CONNECTION, Call, authorization, call
from bench.product import product
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


def row() -> Row:
    """Returns status.p99."""
    with tempfile.TemporaryDirectory() as directory:
        admin = CredentialAdmin(CredentialDirectory(Path(directory) / "credentials"), "bench")
        admin.initialize((_HOST,))
        bundles = [
            admin.add(CredentialRequest(f"caller-{number}", Role.VIEWER))[1] for number in range(CALLERS)
        ]
        security = {"credentials": str(Path(directory) / "credentials")}
        first = Credentials(ca_certificate=bundles[0].ca_certificate, token=bundles[0].token)
        with product(Path(directory), {"security": security}, first) as running:
            ours_ms, reference_ms = uvloop.run(_measure(running.target, bundles))
    return Row(
        name="status.p99",
        what=f"GetSystemStatus, {CALLERS} callers at {1 / PERIOD_S:.0f} Hz over TLS, default limits: 99th"
        " percentile from due to answered, against the health service's Check",
        unit="ms",
        values=ours_ms,
        references=reference_ms,
        bar=1.3,
    )


async def _measure(target: str, bundles: list[LoginBundle]) -> tuple[list[float], list[float]]:
    credentials = grpc.ssl_channel_credentials(bundles[0].ca_certificate)
    channels = [grpc.aio.secure_channel(target, credentials, options=OWN_CONNECTION) for _ in bundles]
    health: Any = health_pb2_grpc.HealthStub
    status = [
        call(RobotGatewayStub(channel).GetSystemStatus, GetSystemStatusRequest(), authorization(bundle))
        for channel, bundle in zip(channels, bundles, strict=True)
    ]
    check = [
        call(health(channel).Check, health_pb2.HealthCheckRequest(), authorization(bundle))
        for channel, bundle in zip(channels, bundles, strict=True)
    ]
    ours_ms, reference_ms = [], []
    try:
        await asyncio.gather(*(each() for each in (*status, *check)))
        for number in range(FEWEST_ROUNDS):
            ours, reference = await asyncio.gather(_round(status, 0.0), _round(check, PERIOD_S / 2))
            ours_ms.append(ours)
            reference_ms.append(reference)
            log(f"status.p99: round {number + 1}, {ours:.2f} ms against {reference:.2f} ms")
    finally:
        for channel in channels:
            await channel.close()
    return ours_ms, reference_ms


async def _round(calls: list[Call], shift_s: float) -> float:
    """Returns the 99th percentile of one round, in ms."""
    begin_s = time.perf_counter() + PERIOD_S + shift_s
    phases_s = [random.Random(number).uniform(0, PERIOD_S) for number in range(len(calls))]
    found = await asyncio.gather(
        *(_caller(each, begin_s + phase_s) for each, phase_s in zip(calls, phases_s, strict=True))
    )
    return statistics.quantiles([took_s for caller in found for took_s in caller], n=100)[98] * 1000


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
