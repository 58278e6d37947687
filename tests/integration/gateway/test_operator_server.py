"""The reading methods over a real connection, good requests and bad ones."""

import asyncio
import socket
import time
from collections.abc import AsyncIterator
from pathlib import Path

import grpc
import pytest

from common.errors import UserError
from gateway.rpc.responses.response_cache import REUSE_S
from omniseer.gateway.v1 import states_pb2 as states
from omniseer.gateway.v1.robot_gateway_pb2 import GetSystemStatusRequest
from tests.support.eventually import eventually
from tests.support.free import free_tcp_port
from tests.support.running_gateway import Operator, raw_unary, running_gateway

STATUS = "/omniseer.gateway.v1.RobotGateway/GetSystemStatus"
SWITCH = "/omniseer.gateway.v1.RobotGateway/SetPreviewMode"


@pytest.fixture
async def operator(tmp_path: Path) -> AsyncIterator[Operator]:
    async with running_gateway(
        tmp_path / "preview.sock", name="lab", platform={"interval_ms": 100}
    ) as operator:
        yield operator


async def test_a_gateway_without_sources_is_healthy_and_reports_its_computer(operator: Operator) -> None:
    status = await eventually(operator.status, lambda it: it.platform.compute.available, "a platform sample")
    assert status.gateway_name == "lab"
    assert status.gateway_version
    assert not status.insecure
    assert (status.health.state, status.health.summary) == (states.ROBOT_HEALTH_OK, "robot healthy")
    assert status.health.ready
    assert status.platform.compute.ram_total_bytes > 0
    assert not status.platform.compute.stale


async def test_a_gateway_that_can_not_have_its_socket_gives_the_port_back(tmp_path: Path) -> None:
    port = free_tcp_port()
    with pytest.raises(UserError, match="directory") as seen:
        async with running_gateway(
            tmp_path / "p.sock", port=port, grpc={"port": port, "socket": tmp_path / "none" / "g.sock"}
        ):
            pass
    # The traceback still holds all that was alive then.
    assert seen.value.__traceback__
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", port))
        probe.listen()


async def test_ages_grow_with_the_clock(tmp_path: Path) -> None:
    async with running_gateway(tmp_path / "p.sock", platform={"interval_ms": 60_000}) as operator:
        await eventually(operator.status, lambda it: it.platform.compute.available, "a sample")
        begin_s = time.monotonic()
        first = await operator.status()
        later = await eventually(
            operator.status,
            lambda it: it.platform.compute.age_ms >= first.platform.compute.age_ms + 300,
            "the age has grown",
        )
        passed_ms = (time.monotonic() - begin_s) * 1000
        grown_ms = later.platform.compute.age_ms - first.platform.compute.age_ms
        # The first may be as old as a response is reused for, and both are cut to whole milliseconds.
        assert grown_ms <= passed_ms + 1000 * REUSE_S + 1
        stale = await eventually(operator.status, lambda it: it.platform.compute.stale, "staleness")
        assert stale.platform.compute.age_ms > 3000


async def test_the_overlay_holds_the_same_status(operator: Operator) -> None:
    overlay = await operator.overlay()
    assert overlay.status.gateway_name == "lab"
    assert not overlay.detections.available
    assert list(overlay.events) == []


async def test_many_callers_are_served_at_once(operator: Operator) -> None:
    answers = await asyncio.gather(*(operator.status() for _ in range(200)))
    assert {answer.gateway_name for answer in answers} == {"lab"}


async def test_a_flood_is_refused_as_such_and_leaves_nothing_behind(operator: Operator) -> None:
    # All of them take seconds; a deadline in the midst of them would be no refusal.
    calls = [operator.stub.GetSystemStatus(GetSystemStatusRequest(), timeout=60) for _ in range(3000)]
    answers = await asyncio.gather(*calls, return_exceptions=True)
    errors = [answer for answer in answers if isinstance(answer, BaseException)]
    assert all(isinstance(error, grpc.aio.AioRpcError) for error in errors)
    refusals = {error.code() for error in errors if isinstance(error, grpc.aio.AioRpcError)}
    # Too many at work, or so many on one connection that HTTP/2 itself takes them back.
    assert refusals <= {
        grpc.StatusCode.RESOURCE_EXHAUSTED,
        grpc.StatusCode.CANCELLED,
        grpc.StatusCode.UNAVAILABLE,
    }
    assert len(errors) < len(answers)
    assert (await operator.status()).gateway_name == "lab"


@pytest.mark.parametrize("method", [STATUS, SWITCH])
async def test_bytes_that_are_no_message_end_that_call_only(operator: Operator, method: str) -> None:
    with pytest.raises(grpc.aio.AioRpcError):
        await raw_unary(operator.channel, method)(b"\x08")
    assert (await operator.status()).gateway_name == "lab"


async def test_fields_of_a_later_contract_are_ignored(operator: Operator) -> None:
    # Field 2047, a string of three bytes.
    assert await raw_unary(operator.channel, STATUS)(b"\xfa\x7f\x03new")


async def test_a_request_beyond_all_measure_is_refused(operator: Operator) -> None:
    with pytest.raises(grpc.aio.AioRpcError) as seen:
        await raw_unary(operator.channel, STATUS)(b"\xfa\x7f" + b"\x80\x80\x20" + b"x" * (512 * 1024))
    assert seen.value.code() is grpc.StatusCode.RESOURCE_EXHAUSTED
    assert (await operator.status()).gateway_name == "lab"


@pytest.mark.parametrize("method", ["SetTeleopEnabled", "SendTeleopCommand"])
async def test_a_robot_that_is_not_set_up_for_driving_says_so(operator: Operator, method: str) -> None:
    with pytest.raises(grpc.aio.AioRpcError) as seen:
        await raw_unary(operator.channel, f"/omniseer.gateway.v1.RobotGateway/{method}")(b"")
    assert seen.value.code() is grpc.StatusCode.FAILED_PRECONDITION
    assert not (await operator.status()).HasField("teleop")


async def test_an_open_gateway_says_so(tmp_path: Path) -> None:
    async with running_gateway(tmp_path / "p.sock", security={"insecure": True}) as operator:
        assert (await operator.status()).insecure


async def test_a_second_gateway_on_the_port_is_an_error(operator: Operator, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=f"port {operator.port} on 127.0.0.1 is taken"):
        async with running_gateway(tmp_path / "q.sock", grpc={"port": operator.port}):
            pass
