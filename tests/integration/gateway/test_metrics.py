"""The metrics of a whole gateway, read as Prometheus does and as it should not be."""

import asyncio
import socket
import urllib.error
import urllib.request
from pathlib import Path

import grpc
import pytest
from prometheus_client.parser import text_string_to_metric_families

from common.errors import UserError
from common.metrics_endpoint import serving_metrics
from omniseer.gateway.v1.robot_gateway_pb2 import WatchSystemStatusRequest
from tests.support.eventually import eventually
from tests.support.free import free_tcp_port
from tests.support.running_gateway import running_gateway

LONG_S = 10


async def read(port: int, path: str = "/metrics", method: str = "GET") -> str:
    request = urllib.request.Request(f"http://127.0.0.1:{port}{path}", method=method)

    def answer() -> str:
        with urllib.request.urlopen(request, timeout=LONG_S) as reply:  # noqa: S310  # always http
            return str(reply.read().decode())

    return await asyncio.to_thread(answer)


async def read_or_nothing(port: int) -> str:
    try:
        return await read(port)
    except OSError:
        return ""


async def samples(port: int) -> dict[tuple[str, ...], float]:
    families = text_string_to_metric_families(await read(port))
    return {
        (each.name, *(value for _, value in sorted(each.labels.items()))): each.value
        for family in families
        for each in family.samples
    }


async def test_calls_of_a_real_gateway_are_counted(tmp_path: Path) -> None:
    port = free_tcp_port()
    async with running_gateway(tmp_path / "preview.sock", metrics={"port": port}) as operator:
        await asyncio.gather(*(operator.status() for _ in range(5)))
        with pytest.raises(grpc.aio.AioRpcError):
            await operator.switch(enabled=True, profile=9)
        shown = await samples(port)
        assert shown["robot_gateway_requests_total", "OK", "GetSystemStatus"] == 5
        assert shown["robot_gateway_requests_total", "INVALID_ARGUMENT", "SetPreviewMode"] == 1
        assert shown["robot_gateway_preview_state", "disabled"] == 1
        assert shown["robot_gateway_uptime_seconds",] > 0
        again = await samples(port)
        assert again["robot_gateway_uptime_seconds",] > shown["robot_gateway_uptime_seconds",]


async def test_a_caller_who_leaves_is_counted_as_such(tmp_path: Path) -> None:
    port, preview = free_tcp_port(), tmp_path / "preview.sock"
    with socket.socket(socket.AF_UNIX) as silent:
        # Connections to it come about, and nothing is ever said on them: a request is on its way for a while.
        silent.bind(str(preview))
        silent.listen()
        async with running_gateway(preview, metrics={"port": port}) as operator:
            waiting = asyncio.create_task(operator.switch(enabled=True, timeout_s=None))
            await eventually(operator.status, lambda status: status.preview.profile, "the request is there")
            waiting.cancel()
            left = ("robot_gateway_requests_total", "CANCELLED", "SetPreviewMode")
            await eventually(lambda: samples(port), lambda shown: shown.get(left) == 1, "it is counted")


async def test_without_a_port_there_are_none(tmp_path: Path) -> None:
    async with running_gateway(tmp_path / "preview.sock"):
        names = {task.get_name() for task in asyncio.all_tasks()}
    assert "observer" in names
    assert "loop-delay" not in names


@pytest.mark.parametrize(("path", "method", "code"), [("/", "GET", 404), ("/metrics", "POST", 405)])
async def test_nothing_else_is_served(path: str, method: str, code: int) -> None:
    async with serving_metrics(lambda: b"x 1\n", "127.0.0.1", 0) as port:
        with pytest.raises(urllib.error.HTTPError) as refused:
            await read(port, path, method)
        assert refused.value.code == code
        refused.value.close()
        assert await read(port) == "x 1\n"
        assert await read(port, method="HEAD") == ""


@pytest.mark.parametrize(
    "garbage", [b"\r\n\r\n", b"\x16\x03\x01\x02\r\n\r\n", b"GET\r\n\r\n", b"x" * 100_000], ids=repr
)
async def test_garbage_is_hung_up_on(garbage: bytes) -> None:
    async with serving_metrics(lambda: b"x 1\n", "127.0.0.1", 0) as port:
        with socket.create_connection(("127.0.0.1", port), LONG_S) as caller:
            await asyncio.to_thread(caller.sendall, garbage)
            try:
                said = await asyncio.to_thread(caller.recv, 100)
            except ConnectionResetError:
                said = b""
            assert said == b"" or said.startswith(b"HTTP/1.1 404 ")
        assert await read(port) == "x 1\n"


async def test_slow_callers_are_few_and_are_left_behind() -> None:
    async with serving_metrics(lambda: b"x 1\n", "127.0.0.1", 0) as port:
        slow = [socket.create_connection(("127.0.0.1", port), LONG_S) for _ in range(4)]
        for each in slow:
            each.sendall(b"GET /met")
        assert await read_or_nothing(port) == "", "one too many is hung up on"
        await eventually(
            lambda: read_or_nothing(port), lambda text: text == "x 1\n", "the slow ones are gone"
        )
        for each in slow:
            each.close()


async def test_a_taken_port_is_one_line() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(UserError, match=rf"metrics can't be served at 127\.0\.0\.1:{port}"):
            async with serving_metrics(lambda: b"", "127.0.0.1", port):
                pass


async def test_an_open_stream_is_counted_until_it_ends(tmp_path: Path) -> None:
    port = free_tcp_port()
    async with running_gateway(tmp_path / "preview.sock", metrics={"port": port}) as operator:
        watching = operator.stub.WatchSystemStatus(WatchSystemStatusRequest(), timeout=LONG_S)
        await watching.read()
        stream = ("robot_gateway_streams", "WatchSystemStatus")
        assert (await samples(port))[stream] == 1
        watching.cancel()
        await eventually(lambda: samples(port), lambda shown: stream not in shown, "it is closed")
