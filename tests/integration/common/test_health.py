"""The health service on a real server, asked by the containers' own check and by a watcher."""

import asyncio
import subprocess
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import grpc
import pytest
from grpc_health.v1.health_pb2 import HealthCheckRequest, HealthCheckResponse
from grpc_health.v1.health_pb2_grpc import HealthStub

from common.bind import bind_tcp, bind_unix
from common.health import Health
from common.healthcheck import state_of
from common.reasons import Reason
from common.refusal import refusal_in
from common.rpc import new_server

SERVING, NOT_SERVING = HealthCheckResponse.SERVING, HealthCheckResponse.NOT_SERVING


@asynccontextmanager
async def serving(health: Health, socket: Path | None = None) -> AsyncIterator[str]:
    server = new_server()
    health.register(server)
    if socket:
        bind_unix(server, socket)
        target = f"unix:{socket}"
    else:
        target = f"127.0.0.1:{bind_tcp(server, '127.0.0.1', 0)}"
    await server.start()
    try:
        yield target
    finally:
        await server.stop(0)


async def ask(target: str, service: str = "") -> str:
    return await asyncio.to_thread(state_of, target, service)


async def test_the_whole_serves_whatever_its_parts_do() -> None:
    health = Health("the.Contract")
    async with serving(health) as target:
        assert await ask(target) == "SERVING"
        assert await ask(target, "the.Contract") == "SERVING"
        assert (await ask(target, "preview")).startswith("NOT_FOUND")
        health.set_serving("preview", serving=False)
        assert await ask(target, "preview") == "NOT_SERVING"
        assert await ask(target) == "SERVING"
        health.set_serving("preview", serving=True)
        assert await ask(target, "preview") == "SERVING"


async def test_an_unknown_service_is_not_found_with_the_reason_for_programs() -> None:
    async with serving(Health()) as target, grpc.aio.insecure_channel(target) as channel:
        stub: Any = HealthStub(channel)  # its type has no methods
        with pytest.raises(grpc.aio.AioRpcError) as caught:
            await stub.Check(HealthCheckRequest(service="nothing"))
    assert caught.value.code() is grpc.StatusCode.NOT_FOUND
    assert refusal_in(caught.value.trailing_metadata()).reason == Reason.UNKNOWN_SERVICE


async def test_the_refusal_quotes_the_printable_beginning_of_a_name() -> None:
    """The defect: a name of 256 KiB came back whole, control characters included."""
    async with serving(Health()) as target, grpc.aio.insecure_channel(target) as channel:
        stub: Any = HealthStub(channel)  # its type has no methods
        with pytest.raises(grpc.aio.AioRpcError) as caught:
            await stub.Check(HealthCheckRequest(service="\x1b[2J" + 1000 * "n"))
    assert caught.value.code() is grpc.StatusCode.NOT_FOUND
    assert caught.value.details() == f"the service ' [2J{60 * 'n'}' is unknown here"


async def test_watchers_learn_every_change_and_unknown_names_once_they_are_known() -> None:
    health = Health()
    async with serving(health) as target, grpc.aio.insecure_channel(target) as channel:
        watch: Any = channel.unary_stream(
            "/grpc.health.v1.Health/Watch",
            HealthCheckRequest.SerializeToString,
            HealthCheckResponse.FromString,
        )(HealthCheckRequest(service="preview"))
        assert (await watch.read()).status == HealthCheckResponse.SERVICE_UNKNOWN
        health.set_serving("preview", serving=False)
        assert (await watch.read()).status == NOT_SERVING
        health.set_serving("preview", serving=False)
        health.set_serving("preview", serving=True)
        assert (await watch.read()).status == SERVING, "the same status again is not sent"
        watch.cancel()


async def test_the_program_ends_zero_only_while_the_server_serves(tmp_path: Path) -> None:
    def check(target: str) -> tuple[int, str]:
        done = subprocess.run(
            [sys.executable, "-m", "common.healthcheck", target],
            capture_output=True,
            text=True,
            timeout=30,
            check=False,
        )
        return done.returncode, done.stdout

    socket = tmp_path / "served.sock"
    async with serving(Health(), socket) as target:
        assert await asyncio.to_thread(check, target) == (0, f"{target}: SERVING\n")
    code, said = await asyncio.to_thread(check, target)
    assert code == 1
    assert "UNAVAILABLE" in said


def test_the_program_without_a_target_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("HEALTH_TARGET", raising=False)
    done = subprocess.run(
        [sys.executable, "-m", "common.healthcheck"], capture_output=True, text=True, timeout=30, check=False
    )
    assert (done.returncode, done.stdout) == (1, "")
    assert "HEALTH_TARGET" in done.stderr
    assert "Traceback" not in done.stderr
