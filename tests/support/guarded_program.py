"""A gateway program that asks who calls, and a laptop: what `robotctl login` has stored there."""

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.video.foreign import end
from console.client import Credentials, DeadlineExceeded, GatewayClient, PreviewState, Unreachable
from console.robots import read_credentials, read_robots_file
from console.robots.login import parse_login
from gateway.access.credential import Kind
from gateway.access.credential_admin import CredentialAdmin, CredentialRequest
from gateway.access.directory import CredentialDirectory
from gateway.access.role import Role
from tests.support.free import free_tcp_port
from tests.support.guarded_gateway import HOSTS
from tests.support.patient import PATIENT
from tests.support.robotctl import robotctl, robotctl_process
from tests.support.running_preview import RunningPreview
from tests.support.video_ground import switch_on
from tests.support.waiting import wait_until

_ROOT = Path(__file__).parents[2]
_UP_WITHIN_S = 20.0
ROBOT = "lab"
"""As the laptop calls it."""


@dataclass
class Guarded:
    """A guarded gateway in another process, and a laptop.

    Args:
        admin: adds and revokes, as on the robot.
        target: the gateway's address.
        home: the laptop's configuration directory.
        own: an admin's credentials, for the test itself.
        log_file: where the gateway writes.
        pid: of the gateway.
        kind: of all credentials here.
    """

    admin: CredentialAdmin
    target: str
    home: Path
    own: Credentials
    log_file: Path
    pid: int
    kind: Kind = Kind.TOKEN

    def added(self, person: str, role: Role) -> tuple[Credentials, str]:
        """Adds a person's login; the credentials, and the number by which they are revoked."""
        credential, bundle = self.admin.add(CredentialRequest(person, role, self.kind))
        return parse_login(bundle.text()).credentials, credential.credential_id

    def log_in(self, person: str, role: Role) -> dict[str, Any]:
        """Hands a new login over, which the laptop keeps from now on; what `robotctl login --json` said."""
        _, bundle = self.admin.add(CredentialRequest(person, role, self.kind))
        file = self.home / f"{person}.login"
        file.write_text(bundle.text(), encoding="utf-8")
        done = self.robotctl("login", ROBOT, self.target, str(file), "--json", "--replace")
        assert done.returncode == 0, done.stderr
        said: dict[str, Any] = json.loads(done.stdout)
        return said

    def robotctl(self, *words: str) -> "subprocess.CompletedProcess[str]":
        """Typed on the laptop."""
        return robotctl(*words, XDG_CONFIG_HOME=str(self.home))

    def robotctl_process(self, *words: str) -> "subprocess.CompletedProcess[str]":
        """The same by the installed program: video needs a process of its own."""
        return robotctl_process(*words, XDG_CONFIG_HOME=str(self.home))

    def stored(self) -> Credentials:
        """What the laptop has kept last."""
        return read_credentials(read_robots_file(self.home / "robotctl/config.toml").find(ROBOT))

    def client(self) -> GatewayClient:
        """The test's own connection."""
        return GatewayClient(self.target, PATIENT, self.own)

    def log(self) -> str:
        """What the gateway has written so far."""
        return self.log_file.read_text(encoding="utf-8")

    def switch_on(self) -> None:
        """Frames leave when this returns."""
        with self.client() as client:
            switch_on(client)

    def switch_off(self) -> None:
        """The preview is off when this returns."""
        with self.client() as client:
            assert client.disable_preview().preview.state is PreviewState.DISABLED

    def answers(self) -> bool:
        """Whether the gateway is up."""
        with (
            suppress(Unreachable, DeadlineExceeded),
            GatewayClient(self.target, credentials=self.own) as client,
        ):
            client.status()
            return True
        return False


@contextmanager
def guarded_program(
    directory: Path,
    home: Path,
    kind: Kind = Kind.TOKEN,
    descriptors: int | None = None,
    *,
    port: int = 0,
    also_at: str = "",
    **settings: Any,
) -> Iterator[Guarded]:
    """Up when the block begins, gone when it ends.

    Args:
        directory: the robot's files.
        home: the laptop's configuration directory.
        kind: how its callers prove who they are.
        descriptors: how many it may have at the most.
        port: of the gateway; 0 for any.
        also_at: another address of this machine that it is called at; empty for loopback alone.
        settings: keys of the gateway's configuration.
    """
    credentials, port = CredentialDirectory(directory / "credentials"), port or free_tcp_port()
    admin = CredentialAdmin(credentials, ROBOT)
    admin.initialize((*HOSTS, also_at) if also_at else HOSTS)
    _, bundle = admin.add(CredentialRequest("the-test", Role.ADMIN, kind))
    config = directory / "gateway.yaml"
    values = {
        "name": "lab-1",
        "grpc": {"port": port, "host": "0.0.0.0" if also_at else "127.0.0.1"},  # noqa: S104
        "sources": [],
        "security": {
            "credentials": str(credentials.path),
            "tls": {"client_certificates": kind is Kind.CERTIFICATE},
        },
        "preview": {"socket": str(directory / "preview.sock")},
        **settings,
    }
    config.write_text(json.dumps(values), encoding="utf-8")  # JSON is YAML
    command = [sys.executable, "-c", "from gateway.cli import main; main()", "serve", "--config", str(config)]
    if descriptors is not None:
        command = ["prlimit", f"--nofile={descriptors}:{descriptors}", *command]
    log_file = directory / "gateway.log"
    with log_file.open("wb") as log:
        process = subprocess.Popen(command, cwd=_ROOT, stderr=log)
    own = parse_login(bundle.text()).credentials
    robot = Guarded(admin, f"127.0.0.1:{port}", home, own, log_file, process.pid, kind)
    try:
        wait_until(lambda: process.poll() is not None or robot.answers(), "the gateway is up", _UP_WITHIN_S)
        assert process.poll() is None, robot.log()
        yield robot
    finally:
        end(process)


@contextmanager
def guarded_video(directory: Path, home: Path) -> Iterator[Guarded]:
    """The same with the real preview service behind it; the preview is off at first."""
    with (
        RunningPreview(directory) as preview,
        guarded_program(directory, home, preview={"socket": str(preview.socket)}) as robot,
    ):
        yield robot
