"""The bridge's login at a real gateway that asks who calls: used, replaced and refused."""

import asyncio
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from bridge.config import GatewaySettings
from bridge.robot.calls import GatewayCalls
from console.client import GatewayError
from console.client.errors import NotAllowed
from fleet.connection import Hub
from gateway.access.credential_admin import CredentialRequest
from gateway.access.role import Role
from omniseer.gateway.v1 import cloud_pb2
from tests.support.eventually import eventually
from tests.support.guarded_gateway import Robot, guarded_gateway, new_robot, refuse_at_once
from tests.support.nats_servers import NatsServers
from tests.support.running_bridge import BridgeProgram, bridge_program, received

ROOT = Path(__file__).parents[3]
BACK_WITHIN_S = 60.0


def put(path: Path, text: str, mode: int = 0o600) -> None:
    """Puts a file in one step, as install(1) does."""
    new = path.with_suffix(".new")
    new.write_text(text, encoding="utf-8")
    new.chmod(mode)
    new.replace(path)


def added(robot: Robot) -> str:
    """The bridge's login, as `credentials add` prints it."""
    return robot.admin.add(CredentialRequest("bridge", Role.VIEWER))[1].text()


async def status_of(bridge: BridgeProgram) -> cloud_pb2.CloudStatus:
    return await asyncio.to_thread(lambda: bridge.status)


async def well(bridge: BridgeProgram) -> None:
    await eventually(
        lambda: status_of(bridge),
        lambda status: (
            status.state == cloud_pb2.CLOUD_STATE_CONNECTED
            and not (status.last_error or status.outbox_events)
            and status.events_sent + status.events_dropped > 0
        ),
        "it is connected, and has sent what it had",
        BACK_WITHIN_S,
    )


async def test_a_replaced_login_is_used_at_once_and_nothing_is_lost(
    tmp_path: Path, hub: Hub, servers: NatsServers, monkeypatch: pytest.MonkeyPatch
) -> None:
    refuse_at_once(monkeypatch)
    robot, login = new_robot(tmp_path / "credentials"), tmp_path / "gateway.login"
    put(login, added(robot))
    async with guarded_gateway(robot):
        settings = {"target": f"127.0.0.1:{robot.port}", "login": str(login)}
        with bridge_program(tmp_path / "bridge", robot.port, servers.urls, gateway=settings) as bridge:
            await asyncio.to_thread(bridge.start)
            await eventually(
                lambda: received(hub), lambda found: found.batches, "it has begun", BACK_WITHIN_S
            )
            rotated = robot.admin.rotate("bridge")[1].text()
            refused = await eventually(
                lambda: status_of(bridge),
                lambda status: "credentials rotate" in status.last_error,
                "the status says that it is refused, and what to do",
                BACK_WITHIN_S,
            )
            assert refused.state == cloud_pb2.CLOUD_STATE_CONNECTED, "the hub is another matter"
            assert "robotctl login" not in refused.last_error
            put(login, rotated)
            await well(bridge)
            put(login, "not a login")
            robot.admin.rotate("bridge")
            broken = await eventually(
                lambda: status_of(bridge),
                lambda status: "not a login" in status.last_error,
                "what can't be a login is refused as well",
                BACK_WITHIN_S,
            )
            assert str(login) in broken.last_error
            put(login, robot.admin.rotate("bridge")[1].text())
            await well(bridge)
            found = await received(hub)
    run_ids = {run for run, _ in found.events} | {run for run, _ in found.missing}
    assert len(run_ids) == 1, "the gateway's"
    assert found.add_up_to(run_ids.pop(), max(batch.last_sequence for batch in found.batches))


async def test_unary_calls_follow_the_login_as_well(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    refuse_at_once(monkeypatch)
    robot, login = new_robot(tmp_path / "credentials"), tmp_path / "gateway.login"
    put(login, added(robot))

    async def reason(calls: GatewayCalls) -> str:
        """Why recordings can't be listed; this gateway has no recorder."""
        with pytest.raises(GatewayError) as caught:
            await calls.list_recordings(50, "")
        return caught.value.reason

    async with guarded_gateway(robot):
        calls = GatewayCalls(GatewaySettings(target=f"127.0.0.1:{robot.port}", login=login), "run")
        try:
            assert await reason(calls) == "RECORDING_NOT_CONFIGURED", "it was let through to the recorder"
            new = robot.admin.rotate("bridge")[1].text()
            await eventually(
                lambda: reason(calls), lambda found: found == "CREDENTIAL_REVOKED", "it is refused"
            )
            put(login, new)
            await eventually(
                lambda: reason(calls), lambda found: found == "RECORDING_NOT_CONFIGURED", "it is let through"
            )
            login.unlink()
            with pytest.raises(NotAllowed) as caught:
                await calls.recording("one")
            assert "can't be read" in caught.value.what
            assert "credentials rotate" in caught.value.remedy
            put(login, new)
            assert await reason(calls) == "RECORDING_NOT_CONFIGURED"
        finally:
            await calls.aclose()


def check(tmp_path: Path, values: object) -> "subprocess.CompletedProcess[str]":
    config = tmp_path / "bridge.yaml"
    config.write_text(json.dumps(values), encoding="utf-8")
    return subprocess.run(
        [sys.executable, "-m", "bridge.cli", "check", "--config", str(config)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def test_check_reads_the_files_that_are_named(tmp_path: Path) -> None:
    robot, login = new_robot(tmp_path / "credentials"), tmp_path / "gateway.login"
    gateway = {"gateway": {"login": str(login)}}
    refused = check(tmp_path, gateway)
    assert refused.returncode == 2
    assert f"the login {login} can't be read: No such file" in refused.stderr
    assert refused.stderr.count("\n") == 1
    put(login, added(robot), 0o644)
    assert f"chmod 600 {login}" in check(tmp_path, gateway).stderr
    put(login, "anything")
    assert f"{login}: this is not a login" in check(tmp_path, gateway).stderr
    put(login, added(robot))
    assert check(tmp_path, gateway).returncode == 0
    both = {"gateway": {"login": str(login), "token_file": str(login)}}
    assert "leave out token_file" in check(tmp_path, both).stderr


@pytest.mark.parametrize("key", ["ca", "credentials", "receipts"])
def test_check_reads_the_enrolment(tmp_path: Path, key: str) -> None:
    file = tmp_path / "file"
    named = {"hub": {key: str(file)}}
    missing = check(tmp_path, named)
    assert missing.returncode != 0
    assert f"hub.{key}: {file} can't be read: No such file" in missing.stderr
    assert "robot-bridge enroll" in missing.stderr
    file.write_text("anything", encoding="utf-8")
    wrong = check(tmp_path, named)
    assert (wrong.returncode == 0) is (key == "ca"), "whether a certificate is one, the connection shows"
    assert str(file) in wrong.stderr or key == "ca"
    if os.geteuid():
        file.chmod(0)
        assert "Permission denied" in check(tmp_path, named).stderr
