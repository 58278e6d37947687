"""The compose files at work: a project of its own per test, on free ports, removed with everything in it."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

from testcontainers.compose import DockerCompose

from console.client.blocking import GatewayClient
from console.client.errors import DeadlineExceeded, GatewayError, Unreachable
from console.client.options import ClientOptions
from console.client.results import SystemStatus
from console.credentials import Credentials
from tests.support.engine import ROOT, TAG
from tests.support.free import free_domain, free_tcp_port, free_udp_port
from tests.support.waiting import wait_until

SERVICES = ("gateway", "preview")
_GUARDED = (*SERVICES, "recorder", "tap", "bridge")
_PATIENT = ClientOptions(answer_within_s=10.0)
"""No test here is about a client's deadline, and gateways may stand still with the machine for seconds."""
# Devices, and the kernel's own trees.
_RUNTIME = ("/proc", "/sys", "/dev")


class Deployment:
    """A running compose project.

    Attributes:
        compose: testcontainers' hold on it.
        gateway_port: TCP, on this machine.
        preview_port: UDP, on this machine.
        domain: the ROS domain of its graph.
    """

    def __init__(
        self, compose: DockerCompose, project: str, gateway_port: int, preview_port: int, domain: int
    ) -> None:
        self.compose = compose
        self.project = project
        self.gateway_port = gateway_port
        self.preview_port = preview_port
        self.domain = domain
        self._restarts_before: dict[str, int] = {}

    @property
    def target(self) -> str:
        """Where operators call."""
        return f"127.0.0.1:{self.gateway_port}"

    def client(self, shown: Credentials | None = None) -> GatewayClient:
        """An operator, and what they show."""
        return GatewayClient(self.target, _PATIENT, shown)

    def run(self, *words: str, check: bool = True) -> subprocess.CompletedProcess[str]:
        """`docker compose ...` on this project."""
        done = subprocess.run(
            [*self.compose.compose_command_property, *words],
            cwd=ROOT,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert not check or done.returncode == 0, f"{' '.join(words)}: {done.stderr}"
        return done

    def inspect(self, service: str) -> dict[str, Any]:
        """What the engine knows of a service's container."""
        found: dict[str, Any] = json.loads(docker("inspect", f"{self.project}-{service}-1"))[0]
        return found

    def logs(self, service: str) -> str:
        """What a service has written."""
        return self.run("logs", "--no-log-prefix", service).stdout

    def pids(self, service: str) -> list[int]:
        """Its processes as this machine numbers them, the container's first one first."""
        lines = docker("top", f"{self.project}-{service}-1", "-eo", "pid").split()[1:]
        return sorted(int(line) for line in lines)

    def program_pid(self, service: str) -> int:
        """The program itself: a child of the first process, tini, or of the guard between the two."""
        pid = int(self.inspect(service)["State"]["Pid"])
        for _ in range(2 if service in _GUARDED else 1):
            children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
            pid = int(children[0])
        return pid

    def signal_all(self, service: str, number: signal.Signals) -> None:
        """Sends a signal from outside, as the kernel would: the engine is not asked and does not know."""
        for pid in self.pids(service):
            # The first one is the container's init: with it the kernel ends the others.
            with suppress(ProcessLookupError):
                os.kill(pid, number)

    def restarts(self, service: str) -> int:
        """How often the engine has started it again since the last reset."""
        return int(self.inspect(service)["RestartCount"]) - self._restarts_before.get(service, 0)

    def reset(self) -> None:
        """Puts everything back to how it is after the start, for the next test."""
        if any(self.inspect(service)["State"]["Status"] != "running" for service in SERVICES):
            self.run("up", "--detach")
        with self.client() as robot:
            self.wait_for_status(robot)
            robot.disable_preview()
        self._restarts_before = {service: int(self.inspect(service)["RestartCount"]) for service in SERVICES}

    def time_s(self, service: str, name: str) -> float:
        """A time of the container's state, "StartedAt" or "FinishedAt", on the wall clock."""
        text: str = self.inspect(service)["State"][name]
        # The engine writes up to nine digits of a second; a datetime takes six.
        whole, _, part = text.removesuffix("Z").partition(".")
        return datetime.fromisoformat(f"{whole}+00:00").timestamp() + float(f"0.{part or 0}")

    def wait_healthy(self, *services: str) -> None:
        """Waits for the containers' own health checks."""

        def healthy(service: str) -> bool:
            return bool(self.inspect(service)["State"]["Health"]["Status"] == "healthy")

        for service in services:
            wait_until(partial(healthy, service), f"{service} is healthy", 60)

    def passes_its_check(self, service: str) -> bool:
        """Whether the health check of a service's container passes now: some run every 30 s only."""
        kind, *check = self.inspect(service)["Config"]["Healthcheck"]["Test"]
        assert kind == "CMD"
        return self.run("exec", "-T", service, *check, check=False).returncode == 0

    def wait_for_status(self, robot: GatewayClient) -> SystemStatus:
        """Waits until the robot's graph is seen and the preview is there."""
        return wait_until(lambda: ready(robot), "odometry, vision and the preview reach the operator", 40)


@contextmanager
def answers_are_due() -> Iterator[None]:
    """A block in which a call that fails fails the test, as what does not hold does."""
    try:
        yield
    except GatewayError as error:
        raise AssertionError(f"{type(error).__name__}: {error}") from error


def answered(robot: GatewayClient) -> SystemStatus | None:
    """The status; None while the gateway does not answer."""
    try:
        return robot.status()
    except (Unreachable, DeadlineExceeded):
        return None


def ready(robot: GatewayClient) -> SystemStatus | None:
    """The status when all is there, None before."""
    status = answered(robot)
    return status if status and status.health.ready and status.preview.service_reachable else None


def status_with(
    robot: GatewayClient, holds: Callable[[SystemStatus], bool], what: str, within_s: float = 40.0
) -> SystemStatus:
    """Waits until something holds of the status, and returns it."""

    def asked() -> SystemStatus | None:
        status = answered(robot)
        return status if status and holds(status) else None

    return wait_until(asked, what, within_s)


def is_healthy(status: SystemStatus) -> bool:
    """Whether the robot has no fault at all."""
    return status.health.summary == "robot healthy"


@contextmanager
def deployed(
    directory: Path, *overlays: str, up: bool = True, services: tuple[str, ...] = (), **settings: str
) -> Iterator[Deployment]:
    """compose.yaml with overlays and `.env` settings, until the block ends."""
    with free_domain() as domain:
        gateway_port, preview_port = free_tcp_port(), free_udp_port()
        project = f"robot-gateway-e2e-{domain}-{gateway_port}"
        values = {
            "COMPOSE_PROJECT_NAME": project,
            "TAG": TAG,
            "ROS_DOMAIN_ID": str(domain),
            "GATEWAY_PORT": str(gateway_port),
            "PREVIEW_PORT": str(preview_port),
            "PREVIEW_BIND": "127.0.0.1",
            **settings,
        }
        env_file = directory / f"{project}.env"
        env_file.write_text("".join(f"{key}={value}\n" for key, value in values.items()), encoding="utf-8")
        compose = DockerCompose(
            ROOT,
            [str(ROOT / "compose.yaml"), *overlays],
            env_file=str(env_file),
            wait=False,
            services=list(services) or None,
        )
        deployment = Deployment(compose, project, gateway_port, preview_port, domain)
        try:
            if up:
                compose.start()
            yield deployment
        except BaseException:
            # One after the other: together, the engine mixes their lines.
            for service in deployment.run("ps", "--all", "--services", check=False).stdout.split():
                sys.stderr.write(deployment.run("logs", "--tail", "100", service, check=False).stdout)
            raise
        finally:
            deployment.run("down", "--volumes", "--timeout", "5", check=False)


def demo_overlay() -> str:
    """The simulated robot's overlay."""
    return str(ROOT / "compose.demo.yaml")


def docker(*words: str) -> str:
    """The output of a docker command."""
    return subprocess.run(["docker", *words], capture_output=True, text=True, timeout=120, check=True).stdout


def mounts(pid: int) -> dict[str, set[str]]:
    """Where a process has something mounted, and with which options."""
    lines = Path(f"/proc/{pid}/mountinfo").read_text(encoding="ascii").splitlines()
    return {fields[4]: set(fields[5].split(",")) for fields in map(str.split, lines)}


def writable(pid: int) -> set[str]:
    """What of it can be written; without what every container has from the runtime."""
    return {
        path
        for path, options in mounts(pid).items()
        if "rw" in options and (path == "/dev/shm" or not path.startswith(_RUNTIME))
    }


def udp_ports(deployment: Deployment, service: str) -> set[int]:
    """The UDP ports that are bound in a service's network."""
    # The first process, which outlives the program: the network is the same.
    first = deployment.inspect(service)["State"]["Pid"]
    table = Path(f"/proc/{first}/net/udp").read_text(encoding="ascii")
    return {int(line.split()[1].rpartition(":")[2], 16) for line in table.splitlines()[1:]}
