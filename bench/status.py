"""GetSystemStatus with everything filled, 8 clients at once: against an empty method, and with TLS and token.

Both are called in turns, in short rounds, so that a machine that is busy with something else for a while is
so for both; the median round speaks.
"""

import asyncio
import statistics
import tempfile
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import grpc
import uvloop

from bench.progress import log
from bench.rows import Row
from bench.stack import running_stack
from bench.status_server import EMPTY_METHOD
from gateway.access.credential_admin import CredentialAdmin, CredentialRequest
from gateway.access.directory import CredentialDirectory
from gateway.access.login_bundle import LoginBundle
from gateway.access.role import Role
from omniseer.gateway.v1.robot_gateway_pb2 import GetSystemStatusRequest
from omniseer.gateway.v1.robot_gateway_pb2_grpc import RobotGatewayStub

CLIENTS = 8
ROUNDS = 9
ROUND_S = 1.0
_PEOPLE = 100
# A client each: by default gRPC would let equal channels share one connection.
_OWN_CONNECTION = (("grpc.use_local_subchannel_pool", 1),)

Call = Callable[[], Awaitable[Any]]


@dataclass(frozen=True)
class Round:
    """What one round of one method came to."""

    calls_per_s: float
    p99_ms: float


def run(names: list[str]) -> list[Row]:
    rows = []
    if not names or set(names) & {"status.throughput", "status.p99"}:
        rows += _against_an_empty_method()
    if not names or "status.tls" in names:
        rows.append(_guarded_against_open())
    return [row for row in rows if not names or row.name in names]


def _against_an_empty_method() -> list[Row]:
    with running_stack() as stack:
        empty, status = uvloop.run(_measure(stack.port))
    return [
        Row(
            name="status.throughput",
            what=f"GetSystemStatus against an empty method, {CLIENTS} clients",
            unit="calls/s",
            values=[each.calls_per_s for each in status],
            references=[each.calls_per_s for each in empty],
            bar=0.85,
            better="higher",
        ),
        Row(
            name="status.p99",
            what=f"the same calls: 99th percentile of the time each took, {CLIENTS} clients",
            unit="ms",
            values=[each.p99_ms for each in status],
            references=[each.p99_ms for each in empty],
            bar=1.3,
        ),
    ]


def _guarded_against_open() -> Row:
    with tempfile.TemporaryDirectory() as directory:
        where = CredentialDirectory(Path(directory) / "credentials")
        admin = CredentialAdmin(where, "bench")
        admin.initialize(("127.0.0.1",))
        # As many as a laboratory may have: the one that is shown is found among them.
        bundles = [
            admin.add(CredentialRequest(f"person-{number}", Role.VIEWER))[1] for number in range(_PEOPLE)
        ]
        with running_stack() as plain, running_stack("guarded", str(where.path)) as guarded:
            open_rounds, guarded_rounds = uvloop.run(
                _measure_guarded(plain.port, guarded.port, bundles[_PEOPLE // 2])
            )
    return Row(
        name="status.tls",
        what=f"GetSystemStatus with TLS and a token against the same without, {CLIENTS} clients",
        unit="calls/s",
        values=[each.calls_per_s for each in guarded_rounds],
        references=[each.calls_per_s for each in open_rounds],
        bar=0.75,
        better="higher",
    )


async def _measure_guarded(
    plain_port: int, guarded_port: int, bundle: LoginBundle
) -> tuple[list[Round], list[Round]]:
    credentials = grpc.ssl_channel_credentials(bundle.ca_certificate)
    plain = _channels(plain_port)
    guarded = [
        grpc.aio.secure_channel(f"127.0.0.1:{guarded_port}", credentials, options=_OWN_CONNECTION)
        for _ in range(CLIENTS)
    ]
    metadata = (("authorization", f"Bearer {bundle.token}"),)
    request = GetSystemStatusRequest()
    open_calls = [_calling(RobotGatewayStub(channel).GetSystemStatus, request) for channel in plain]
    guarded_calls = [
        _calling(RobotGatewayStub(channel).GetSystemStatus, request, metadata) for channel in guarded
    ]
    try:
        return await _in_turns(open_calls, guarded_calls, "status.tls")
    finally:
        for channel in (*plain, *guarded):
            await channel.close()


def _channels(port: int) -> list[grpc.aio.Channel]:
    return [grpc.aio.insecure_channel(f"127.0.0.1:{port}", options=_OWN_CONNECTION) for _ in range(CLIENTS)]


async def _measure(port: int) -> tuple[list[Round], list[Round]]:
    channels = _channels(port)
    empty_calls = [_calling(channel.unary_unary(EMPTY_METHOD), b"") for channel in channels]
    request = GetSystemStatusRequest()
    status_calls = [_calling(RobotGatewayStub(channel).GetSystemStatus, request) for channel in channels]
    try:
        return await _in_turns(empty_calls, status_calls, "status")
    finally:
        for channel in channels:
            await channel.close()


async def _in_turns(reference: list[Call], ours: list[Call], what: str) -> tuple[list[Round], list[Round]]:
    """A round of one, a round of the other; the first of each only warms up."""
    await _round(reference)
    await _round(ours)
    of_reference, of_ours = [], []
    for number in range(ROUNDS):
        of_reference.append(await _round(reference))
        of_ours.append(await _round(ours))
        log(f"{what}: round {number + 1} of {ROUNDS}")
    return of_reference, of_ours


def _calling(method: Any, request: Any, metadata: tuple[tuple[str, str], ...] = ()) -> Call:
    return lambda: method(request, metadata=metadata)


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
