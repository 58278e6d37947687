"""GetSystemStatus with everything filled, called by 8 clients as fast as it answers.

The references are an empty method on the same server, and the same method without TLS and token. Both are
called in turns, in short rounds, so that a machine that is busy with something else for a while is so for
both. The limits are out of the way: they would refuse most of these calls. bench/open_loop.py has the real
program with its limits, at the rate at which operators call.
"""

import asyncio
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import grpc
import uvloop

from bench import open_loop
from bench.calling import OWN_CONNECTION, Call, authorization, call
from bench.processes import cpu_seconds
from bench.progress import log
from bench.rows import Row
from bench.stack import Stack, running_stack
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


@dataclass(frozen=True)
class Round:
    """One round of one method.

    Attributes:
        calls_per_s: of all clients together.
        cpu_us: CPU time of the server for each call.
    """

    calls_per_s: float
    cpu_us: float


def run(names: list[str]) -> list[Row]:
    rows = []
    if not names or set(names) & {"status.throughput", "status.cpu_per_call"}:
        rows += _against_an_empty_method()
    if not names or "status.tls" in names:
        rows.append(_guarded_against_open())
    if not names or "status.p99" in names:
        rows.append(open_loop.p99_row())
    if not names or "status.cpu_per_call_real" in names:
        rows.append(open_loop.cpu_row())
    return [row for row in rows if not names or row.name in names]


def _against_an_empty_method() -> list[Row]:
    with running_stack() as stack:
        empty, status = uvloop.run(_measure(stack))
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
            name="status.cpu_per_call",
            what="the same calls: CPU of the server for each",
            unit="us",
            values=[each.cpu_us for each in status],
            references=[each.cpu_us for each in empty],
            bar=1.25,
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
                _measure_guarded(plain, guarded, bundles[_PEOPLE // 2 :][:CLIENTS])
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
    plain: Stack, guarded: Stack, bundles: list[LoginBundle]
) -> tuple[list[Round], list[Round]]:
    credentials = grpc.ssl_channel_credentials(bundles[0].ca_certificate)
    open_channels = _channels(plain.port)
    target = f"127.0.0.1:{guarded.port}"
    secure_channels = [
        grpc.aio.secure_channel(target, credentials, options=OWN_CONNECTION) for _ in range(CLIENTS)
    ]
    request = GetSystemStatusRequest()
    open_calls = [call(RobotGatewayStub(channel).GetSystemStatus, request) for channel in open_channels]
    guarded_calls = [
        call(RobotGatewayStub(channel).GetSystemStatus, request, authorization(bundle))
        for channel, bundle in zip(secure_channels, bundles, strict=True)
    ]
    try:
        return await _in_turns(open_calls, plain.pid, guarded_calls, guarded.pid, "status.tls")
    finally:
        for channel in (*open_channels, *secure_channels):
            await channel.close()


def _channels(port: int) -> list[grpc.aio.Channel]:
    return [grpc.aio.insecure_channel(f"127.0.0.1:{port}", options=OWN_CONNECTION) for _ in range(CLIENTS)]


async def _measure(stack: Stack) -> tuple[list[Round], list[Round]]:
    channels = _channels(stack.port)
    empty_calls = [call(channel.unary_unary(EMPTY_METHOD), b"") for channel in channels]
    request = GetSystemStatusRequest()
    status_calls = [call(RobotGatewayStub(channel).GetSystemStatus, request) for channel in channels]
    try:
        return await _in_turns(empty_calls, stack.pid, status_calls, stack.pid, "status")
    finally:
        for channel in channels:
            await channel.close()


async def _in_turns(
    reference: list[Call], reference_pid: int, ours: list[Call], pid: int, what: str
) -> tuple[list[Round], list[Round]]:
    """Measures a round of one, a round of the other; the first of each only warms up."""
    await _round(reference, reference_pid)
    await _round(ours, pid)
    of_reference, of_ours = [], []
    for number in range(ROUNDS):
        of_reference.append(await _round(reference, reference_pid))
        of_ours.append(await _round(ours, pid))
        log(f"{what}: round {number + 1} of {ROUNDS}")
    return of_reference, of_ours


async def _round(calls: list[Call], pid: int) -> Round:
    """Every client calls again as soon as it has its answer."""
    cpu_s, begin_s = cpu_seconds(pid), time.perf_counter()

    async def client(each: Call) -> int:
        count = 0
        while time.perf_counter() < begin_s + ROUND_S:
            await each()
            count += 1
        return count

    count = sum(await asyncio.gather(*(client(each) for each in calls)))
    passed_s = time.perf_counter() - begin_s
    return Round(calls_per_s=count / passed_s, cpu_us=(cpu_seconds(pid) - cpu_s) / count * 1e6)
