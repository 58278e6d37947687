"""The programs of the fleet's demo, started in order and stopped in reverse."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, TypeVar

from common.errors import UserError
from hub import administration
from tests.support.free import free_domain, free_tcp_port
from tests.support.s3_server import S3Server, s3_server
from tests.support.secure_hub import SecureHub, secure_hub
from tests.support.waiting import wait_until

ROBOTS: Final = ("lab1", "lab2", "lab3")
NODES: Final = 3
_BIN: Final = Path(sys.executable).parent
_ENDS_WITHIN_S: Final = 10.0
_FOREIGN: Final = ("ROS_", "RMW_", "GATEWAY__", "BRIDGE__", "RECORDER__", "RECEIVER__")
_TAIL_LINES: Final = 5

ResultT = TypeVar("ResultT")


@dataclass
class Programs:
    """Processes with a log each.

    Args:
        directory: Of their logs.
    """

    directory: Path
    running: dict[str, "subprocess.Popen[bytes]"] = field(default_factory=dict)

    def start(self, name: str, *words: str, **environment: str) -> None:
        """Starts a program of this checkout; it ends with this process at the latest."""
        kept = {key: value for key, value in os.environ.items() if not key.startswith(_FOREIGN)}
        program, *arguments = words
        command = ["setpriv", "--pdeathsig", "TERM", str(_BIN / program), *arguments]
        with (self.directory / f"{name}.log").open("wb") as log:
            self.running[name] = subprocess.Popen(  # noqa: S603 - programs of this checkout
                command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=kept | environment
            )

    def check_alive(self) -> None:
        """Raises UserError for a program that has ended, with the end of its log."""
        for name, process in self.running.items():
            if process.poll() is not None:
                lines = (self.directory / f"{name}.log").read_text(errors="replace").splitlines()
                tail = "; ".join(lines[-_TAIL_LINES:])
                raise UserError(f"{name} has ended with {process.returncode}: {tail}")

    def wait_until(self, condition: Callable[[], ResultT | None], what: str, within_s: float) -> ResultT:
        """Returns the first true answer, while all programs are alive.

        Raises:
            UserError: It did not come in time, or a program has ended.
        """

        def ask() -> ResultT | None:
            self.check_alive()
            return condition()

        try:
            return wait_until(ask, what, within_s)
        except AssertionError as error:
            raise UserError(str(error)) from error

    def stop(self) -> None:
        """Ends all, the last one first.

        Raises:
            UserError: One did not end in order.
        """
        late = []
        for name, process in reversed(self.running.items()):
            process.terminate()
            try:
                process.wait(_ENDS_WITHIN_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                late.append(name)
        self.running.clear()
        if late:
            raise UserError(f"{', '.join(late)} did not end within {_ENDS_WITHIN_S:g} s")


@dataclass
class FleetGround:
    """Everything that runs.

    Args:
        directory: Of all files; removed at the end.
        hub: Three nodes with identities, and its administration.
        programs: Robots and receiver.
        home: Where robotctl finds the operator's login.
        store: A stand-in for a real one.
        domains: ROS domain of each robot: none sees another one's graph.
    """

    directory: Path
    hub: SecureHub
    programs: Programs
    home: Path
    store: S3Server
    domains: dict[str, int]

    def robotctl(self, *words: str) -> dict[str, Any]:
        """Returns the JSON answer of `robotctl fleet`.

        Raises:
            UserError: It failed.
        """
        done = subprocess.run(  # noqa: S603 - a program of this checkout
            [_BIN / "robotctl", "fleet", *words, "--json"],
            capture_output=True,
            text=True,
            check=False,
            env=os.environ | {"XDG_CONFIG_HOME": str(self.home)},
        )
        if done.returncode != 0:
            raise UserError(f"robotctl fleet {' '.join(words)}: {done.stderr or done.stdout}")
        answer: dict[str, Any] = json.loads(done.stdout)
        return answer

    def events(self) -> list[dict[str, Any]]:
        """Returns what the hub has of all robots' events, gaps included."""
        done = subprocess.run(  # noqa: S603 - a program of this checkout
            [_BIN / "robotctl", "fleet", "events", "--json"],
            capture_output=True,
            text=True,
            check=False,
            env=os.environ | {"XDG_CONFIG_HOME": str(self.home)},
        )
        return [json.loads(line) for line in done.stdout.splitlines()] if done.returncode == 0 else []

    def rows(self) -> dict[str, dict[str, Any]]:
        """Returns the fleet's rows by robot; none while the hub does not answer."""
        with suppress(UserError):
            return {row["robot"]: row for row in self.robotctl("list")["robots"]}
        return {}

    def control_socket(self, robot: str) -> Path:
        """Returns the socket through which a simulated robot changes its behaviour."""
        return self.directory / robot / "robot.sock"


@contextmanager
def fleet_ground(directory: Path) -> Iterator[FleetGround]:
    """The hub, the store and the operator's login when the block begins; all programs are gone when it ends.

    Robots and the receiver are started by `start_receiver` and `start_robot`.
    """
    with ExitStack() as stack:
        hub = stack.enter_context(secure_hub(directory, NODES))
        store = stack.enter_context(s3_server(directory))
        domains = {robot: stack.enter_context(free_domain()) for robot in ROBOTS}
        ground = FleetGround(directory, hub, Programs(directory), directory / "home", store, domains)
        stack.callback(ground.programs.stop)
        login = administration.operator_login(hub.directory, "demo", commands=True, days=None, again=False)
        (directory / "demo.login").write_text(login, encoding="utf-8")
        ground.robotctl("login", str(directory / "demo.login"))
        yield ground


def start_receiver(ground: FleetGround) -> None:
    """Starts a receiver of recordings."""
    ground.hub.receiver()
    store = ground.store.settings()
    folder = ground.directory / "receiver"
    values = {
        "fleet": "lab",
        "hub": {
            "servers": list(ground.hub.servers.urls),
            "credentials": str(folder / "receiver.creds"),
            "ca": str(folder / "ca.pem"),
        },
        "store": store.model_dump(mode="json"),
        "signing_key": str(folder / "receipts.key"),
        "socket": str(ground.directory / "receiver.sock"),
    }
    config = _write(ground.directory / "receiver.yaml", values)
    ground.programs.start("receiver", "robot-bridge", "hub", "receiver", "--config", str(config))


def start_robot(ground: FleetGround, robot: str) -> None:
    """Enrolls a robot and starts it: simulated robot, recorder, gateway and bridge."""
    ground.hub.enroll(robot)
    folder = ground.directory / robot
    port = free_tcp_port()
    sockets = {name: str(folder / f"{name}.sock") for name in ("recorder", "bridge", "preview")}
    ros = {"ROS_DOMAIN_ID": str(ground.domains[robot]), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    gateway = {
        "name": robot,
        "grpc": {"host": "127.0.0.1", "port": port},
        "preview": {"socket": sockets["preview"]},
        "recording": {"socket": sockets["recorder"]},
        "bridge": {"socket": sockets["bridge"], "allowed_requests": ["upload", "snapshot"]},
    }
    recorder = {
        "socket": sockets["recorder"],
        "root": str(folder / "recordings"),
        "room": {"min_free_bytes": 0},
        "ring": {"preset": "driving", "seconds": 20},
    }
    store_host = ground.store.url.removeprefix("http://")
    bridge = {
        "socket": sockets["bridge"],
        "root": str(folder / "outbox"),
        "gateway": {"target": f"127.0.0.1:{port}"},
        "hub": {
            "servers": list(ground.hub.servers.urls),
            "credentials": str(folder / "bridge.creds"),
            "ca": str(folder / "ca.pem"),
            "receipts": str(folder / "receipts.pub"),
            "robot": robot,
            "fleet": "lab",
        },
        "commands": {"allowed": ["upload", "snapshot"]},
        "uploads": {"store_hosts": [store_host], "insecure_store": True},
        "advertised_target": f"127.0.0.1:{port}",
    }
    start = ground.programs.start
    start(f"{robot}-simrobot", "simrobot", "run", "--control", str(ground.control_socket(robot)), **ros)
    for program, values in (("recorder", recorder), ("gateway", gateway), ("bridge", bridge)):
        config = _write(folder / f"{program}.yaml", values)
        start(f"{robot}-{program}", f"robot-{program}", "serve", "--config", str(config), **ros)


def _write(path: Path, values: dict[str, Any]) -> Path:
    # JSON is YAML, and needs no library here.
    path.write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")
    return path
