"""Authenticated callers get the stream's passphrase, from any address; others do not."""

import asyncio
import ipaddress
from pathlib import Path
from typing import Any

import grpc
import pytest

from common.reasons import Reason
from common.refusal import refusal_in
from gateway.access.role import Role
from gateway.platform.hosts import find_hosts
from omniseer.gateway.v1.robot_gateway_pb2 import (
    GetOverlaySnapshotRequest,
    GetSystemStatusRequest,
    SetPreviewModeRequest,
    WatchSystemStatusRequest,
)
from omniseer.gateway.v1.robot_gateway_pb2_grpc import RobotGatewayStub
from omniseer.gateway.v1.states_pb2 import PREVIEW_RUNNING
from tests.support.eventually import eventually
from tests.support.free import free_tcp_port
from tests.support.guarded_gateway import HOSTS, guarded_gateway, new_robot
from tests.support.preview_double import Behaviour, PreviewDouble, serve_double
from tests.support.running_gateway import Operator, running_gateway


@pytest.fixture
def own_address() -> str:
    """By which this machine is called as if from another one."""
    for host in find_hosts():
        try:
            address = ipaddress.ip_address(host)
        except ValueError:
            continue
        if address.version == 4 and not address.is_loopback:
            return host
    pytest.skip("this machine has no address but the loopback's")


async def test_authenticated_callers_get_the_passphrase_in_every_answer(
    tmp_path: Path, own_address: str
) -> None:
    robot, double = new_robot(tmp_path / "c"), PreviewDouble()
    robot.admin.rotate_server((*HOSTS, own_address))
    robot.host = own_address
    shown = robot.add(Role.OPERATOR)[1].metadata()
    server = await serve_double(robot.directory.path / "preview.sock", double)
    try:
        async with guarded_gateway(robot, grpc={"host": "0.0.0.0"}):  # noqa: S104  # what this test is about
            calls: Any = RobotGatewayStub(robot.channel())

            async def switched() -> Any:
                return await calls.SetPreviewMode(
                    SetPreviewModeRequest(enabled=True), metadata=shown, timeout=5
                )

            await eventually(
                switched, lambda reply: reply.preview.state == PREVIEW_RUNNING, "the preview is running"
            )
            passphrase = double.applied[-1].passphrase
            assert len(passphrase) >= 10
            status = await calls.GetSystemStatus(GetSystemStatusRequest(), metadata=shown, timeout=5)
            overlay = await calls.GetOverlaySnapshot(GetOverlaySnapshotRequest(), metadata=shown, timeout=5)
            watching = calls.WatchSystemStatus(WatchSystemStatusRequest(), metadata=shown, timeout=5)
            watched = await watching.read()
            watching.cancel()
            previews = [
                status.preview,
                overlay.status.preview,
                watched.status.preview,
                (await switched()).preview,
            ]
            assert [each.endpoint.passphrase for each in previews] == [passphrase] * 4
            assert passphrase not in robot.audit_file.read_text()
    finally:
        await server.stop(None)


async def test_who_is_let_in_no_more_knows_a_passphrase_that_is_worth_nothing(tmp_path: Path) -> None:
    robot, double = new_robot(tmp_path / "c"), PreviewDouble()
    shown = robot.add(Role.OPERATOR)[1].metadata()
    ben, bens = robot.add(Role.VIEWER, name="ben")
    server = await serve_double(robot.directory.path / "preview.sock", double)
    try:
        async with guarded_gateway(robot):
            calls: Any = RobotGatewayStub(robot.channel())

            async def status() -> Any:
                return await calls.GetSystemStatus(GetSystemStatusRequest(), metadata=shown, timeout=5)

            await eventually(status, lambda it: it.preview.service_reachable, "they have met")
            await calls.SetPreviewMode(SetPreviewModeRequest(enabled=True), metadata=shown, timeout=5)
            await calls.GetSystemStatus(GetSystemStatusRequest(), metadata=bens.metadata(), timeout=5)

            async def applied() -> list[Any]:
                return list(double.applied)

            (before,) = await eventually(applied, len, "the request has arrived")
            robot.admin.revoke(ben.credential_id)
            known = await eventually(applied, lambda seen: len(seen) > 1, "another request")
            assert [each.enabled for each in known] == [True, True]
            assert known[1].passphrase not in {"", before.passphrase}
            assert (await status()).preview.endpoint.passphrase == known[1].passphrase
    finally:
        await server.stop(None)


async def test_a_pending_request_is_not_answered_with_the_new_passphrase(tmp_path: Path) -> None:
    """Its wait ends with the renewal that the revocation of its own caller has caused."""
    robot, double = new_robot(tmp_path / "c"), PreviewDouble(Behaviour.STAYS_STARTING)
    anna, annas = robot.add(Role.OPERATOR)
    server = await serve_double(robot.directory.path / "preview.sock", double)
    settings = {"socket": robot.directory.path / "preview.sock", "settle_ms": 20_000}
    try:
        async with guarded_gateway(robot, preview=settings):
            calls: Any = RobotGatewayStub(robot.channel())
            pending = asyncio.ensure_future(
                calls.SetPreviewMode(SetPreviewModeRequest(enabled=True), metadata=annas.metadata())
            )

            async def applied() -> int:
                return len(double.applied)

            await eventually(applied, bool, "the request has arrived")
            robot.admin.revoke(anna.credential_id)
            with pytest.raises(grpc.aio.AioRpcError) as seen:
                await asyncio.wait_for(pending, 10)
            assert seen.value.code() is grpc.StatusCode.UNAUTHENTICATED
            assert refusal_in(seen.value.trailing_metadata()).reason == Reason.CREDENTIAL_REVOKED
            await eventually(applied, lambda count: count > 1, "the new passphrase is applied")
    finally:
        await server.stop(None)


async def test_where_no_credential_is_needed_only_this_machine_gets_it(
    tmp_path: Path, own_address: str
) -> None:
    double = PreviewDouble()
    server = await serve_double(tmp_path / "p.sock", double)
    port = free_tcp_port()
    try:
        async with (
            running_gateway(
                tmp_path / "p.sock",
                port=port,
                grpc={"host": "0.0.0.0", "port": port},  # noqa: S104  # what this test is about
                preview={"encrypted": True},
                security={"insecure": True},
            ) as near,
            grpc.aio.insecure_channel(f"{own_address}:{port}") as channel,
        ):
            far = Operator(channel, port)
            await eventually(
                lambda: near.switch(True),
                lambda reply: reply.preview.state == PREVIEW_RUNNING,
                "the preview is running",
            )
            assert (await near.status()).preview.endpoint.passphrase == double.applied[-1].passphrase
            endpoint = (await far.status()).preview.endpoint
            assert endpoint.encrypted
            assert not endpoint.passphrase
    finally:
        await server.stop(None)
