"""What a thief of a robot's files can do with them, and what another user of the robot can't read."""

import base64
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import grpc
import pytest

from common.errors import UserError
from common.reasons import Reason
from console.client import Credentials, GatewayClient, NotAllowed, NotTrusted
from gateway.access.credential import Kind
from gateway.access.directory import CredentialDirectory
from gateway.access.reloader import TlsFiles, load_access
from gateway.access.repeats import BURST
from gateway.access.role import Role
from gateway.access.token import parse_token
from omniseer.gateway.v1.robot_gateway_pb2 import SetPreviewModeRequest
from omniseer.gateway.v1.robot_gateway_pb2_grpc import RobotGatewayStub
from tests.support.free import free_tcp_port
from tests.support.guarded_gateway import Robot, guarded_gateway, new_robot
from tests.support.guarded_program import ROBOT, guarded_program
from tests.support.robotctl import robotctl_process
from tests.support.waiting import wait_until

NOBODY = 65534


@contextmanager
def reachable_directory() -> Iterator[Path]:
    """A directory that every user may enter, as /var/log is; pytest's own are closed to them."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        yield Path(name)


def readable_to_others(file: Path) -> bool:
    done = subprocess.run(["cat", file], user=NOBODY, group=NOBODY, capture_output=True, check=False)
    return done.returncode == 0


def refusal(target: str, credentials: Credentials) -> str:
    with GatewayClient(target, credentials=credentials) as client:
        try:
            client.status()
        except NotAllowed as error:
            return error.reason
    return ""


def test_the_hashes_of_a_stolen_list_are_no_tokens(tmp_path: Path) -> None:
    with guarded_program(tmp_path, tmp_path / "home") as robot:
        assert robot.own.token
        assert refusal(robot.target, robot.own) == ""
        parsed = parse_token(robot.own.token)
        assert parsed
        (stolen,) = CredentialDirectory(tmp_path / "credentials").read_store().credentials.values()
        digest = bytes.fromhex(stolen.proof)
        secrets = (
            stolen.proof,
            stolen.proof[:43],
            base64.urlsafe_b64encode(digest).decode().rstrip("="),
            parsed.secret[:-1] + ("A" if parsed.secret[-1] != "A" else "B"),
        )
        for secret in secrets:
            shown = f"rgt-{stolen.credential_id}.{secret}"
            assert refusal(robot.target, replace(robot.own, token=shown)) == Reason.CREDENTIAL_UNKNOWN, secret


def trusts(target: str, credentials: Credentials) -> bool:
    with GatewayClient(target, credentials=credentials) as client:
        try:
            client.status()
        except NotTrusted:
            return False
    return True


def test_after_a_theft_a_new_ca_makes_the_thief_a_stranger_to_the_laptop(tmp_path: Path) -> None:
    """The thief runs a gateway of the stolen files, which the laptop's user is led to."""
    home, stolen = tmp_path / "home", tmp_path / "stolen"
    home.mkdir()
    with guarded_program(tmp_path, home) as robot:
        robot.log_in("anna", Role.VIEWER)
        shutil.copytree(tmp_path / "credentials", stolen / "credentials")
        with impostor(stolen) as target:
            assert trusts(target, robot.stored()), "until the CA is replaced"
            robot.admin.rotate_ca(None)
            wait_until(
                lambda: not trusts(robot.target, robot.stored()), "the robot shows its new certificate"
            )
            refused = robotctl_process("--robot", ROBOT, "status", XDG_CONFIG_HOME=str(home))
            assert refused.returncode != 0
            ca = str(tmp_path / "credentials/ca.pem")
            done = robot.robotctl("login", ROBOT, robot.target, "--ca", ca)
            assert done.returncode == 0, done.stderr
            assert robot.robotctl("--robot", ROBOT, "status").returncode == 0, "with the token it had"
            assert not trusts(target, robot.stored())


@contextmanager
def impostor(files: Path) -> Iterator[str]:
    """A gateway of these files; its address."""
    port = free_tcp_port()
    config = files / "gateway.yaml"
    config.write_text(
        f"grpc: {{port: {port}}}\nsources: []\npreview: {{socket: {files / 'p.sock'}}}\n"
        f"security: {{credentials: {files / 'credentials'}}}\n"
    )
    command = [sys.executable, "-c", "from gateway.cli import main; main()", "serve", "--config", str(config)]
    log = files / "log"
    with log.open("w") as errors, subprocess.Popen(command, stderr=errors) as process:
        try:
            wait_until(lambda: "serving operators" in log.read_text(), "the impostor serves")
            yield f"127.0.0.1:{port}"
        finally:
            process.terminate()


async def act_and_be_refused(robot: Robot) -> None:
    """Until the audit log has a second file."""
    calls: Any = RobotGatewayStub(robot.channel())
    for name in ("anna", "ben", "cora"):
        _, login = robot.add(Role.OPERATOR, name=name)
        for _ in range(BURST):
            request = SetPreviewModeRequest(enabled=False)
            await calls.SetPreviewMode(request, metadata=login.metadata(), timeout=10)
    with pytest.raises(grpc.aio.AioRpcError):
        await calls.SetPreviewMode(SetPreviewModeRequest(enabled=True), timeout=10)


@pytest.mark.skipif(os.geteuid() != 0, reason="becomes another user")
async def test_another_user_of_the_robot_reads_neither_audit_log_nor_credentials(tmp_path: Path) -> None:
    """Where the directory itself keeps none out, as /var/log does not."""
    robot = new_robot(tmp_path)
    with reachable_directory() as reachable:
        (reachable / "public").write_text("x")
        assert readable_to_others(reachable / "public"), "else this test shows nothing"
        audit = {"file": reachable / "audit.jsonl", "max_kib": 4, "generations": 3}
        async with guarded_gateway(robot, security={"audit": audit}):
            await act_and_be_refused(robot)
        shutil.copytree(robot.directory.path, reachable / "credentials")
        (reachable / "credentials").chmod(0o755)
        written = sorted(reachable.glob("audit*"))
        assert {each.name for each in written} >= {"audit.jsonl", "audit.jsonl.1", "audit-refused.jsonl"}
        secrets = [
            reachable / "credentials" / name for name in ("credentials.json", "ca-key.pem", "server-key.pem")
        ]
        assert [each.name for each in (*written, *secrets) if readable_to_others(each)] == []


def test_a_backup_is_of_use_only_with_the_modes_it_was_made_with(tmp_path: Path) -> None:
    directory = new_robot(tmp_path / "credentials").directory
    restored = CredentialDirectory(tmp_path / "restored")
    shutil.copytree(directory.path, restored.path)
    assert load_access(restored, tls_of(restored))
    for file in (restored.store_file, restored.server.key):
        file.chmod(0o644)  # as cp makes it without -p
        with pytest.raises(UserError, match="other users have access"):
            load_access(restored, tls_of(restored))
        file.chmod(0o600)
    restored.ca.key.chmod(0o644)
    with pytest.raises(UserError, match="other users have access"):
        Robot(restored).add(Role.VIEWER, Kind.CERTIFICATE)


def tls_of(directory: CredentialDirectory) -> TlsFiles:
    return TlsFiles(directory.server.certificate, directory.server.key, directory.ca.certificate)
