"""What the programs stand on: a private directory with their configuration, sockets and logs; ports."""

import json
import os
import shutil
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from common.errors import UserError
from demo_program.sources import Source
from simrobot.base import TIMEOUT_S
from tests.support.free import free_domain, free_port, port_is_free

DEFAULT_GRPC_PORT: Final = 50051
DEFAULT_SRT_PORT: Final = 7100
_TAIL_LINES: Final = 15
# Settings of another robot in the caller's environment must not reach the demo's.
_FOREIGN: Final = (
    "GATEWAY__",
    "PREVIEW__",
    "DRIVE__",
    "SIMROBOT_",
    "PYTHONPATH",
    "RMW_IMPLEMENTATION",
    "DEMO_BEGAN",
)


@dataclass(frozen=True, slots=True)
class Options:
    """Options of the command line; None where the demo chooses."""

    source: Source
    grpc_port: int | None
    srt_port: int | None
    domain: int | None
    any_free_port: bool


@dataclass(slots=True)
class Ground:
    """Where everything of one demo is."""

    directory: Path
    grpc_port: int
    srt_port: int
    domain: int
    logs: dict[str, Path] = field(default_factory=dict)
    logs_wanted: bool = False

    @property
    def target(self) -> str:
        """The gateway's address."""
        return f"127.0.0.1:{self.grpc_port}"

    @property
    def control_socket(self) -> Path:
        """The socket through which the simulated robot changes its behaviour."""
        return self.directory / "robot.sock"

    @property
    def preview_socket(self) -> Path:
        """Where gateway and preview service meet."""
        return self.directory / "preview.sock"

    @property
    def drive_socket(self) -> Path:
        """Where gateway and drive program meet."""
        return self.directory / "drive.sock"

    def environment(self) -> dict[str, str]:
        """For the programs: their own ROS domain, nothing leaves this machine."""
        kept = {name: value for name, value in os.environ.items() if not name.startswith(_FOREIGN)}
        return kept | {
            "ROS_DOMAIN_ID": str(self.domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "PYTHONUNBUFFERED": "1",
        }

    def log_of(self, program: str) -> Path:
        """The program's log file."""
        return self.logs.setdefault(program, self.directory / f"{program}.log")

    def keep_logs(self) -> None:
        """Something failed: the logs outlive the demo."""
        self.logs_wanted = True

    def log_tails(self, only: str = "") -> str:
        """The end of each log, or of one, with its path."""
        names = [only] if only else list(self.logs)
        return "\n".join(self._tail(name) for name in names)

    def _tail(self, program: str) -> str:
        path = self.log_of(program)
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines() if path.exists() else []
        shown = [f"    {line}" for line in lines[-_TAIL_LINES:]] or ["    (it said nothing)"]
        return "\n".join([f"--- the end of {path}", *shown])


@contextmanager
def prepared(options: Options) -> Iterator[Ground]:
    """The ground, with configuration files; removed when the block ends, but for logs that are wanted.

    Raises:
        UserError: a port is taken.
    """
    grpc_port = _port(options, "gRPC", options.grpc_port, DEFAULT_GRPC_PORT, socket.SOCK_STREAM)
    srt_port = _port(options, "SRT", options.srt_port, DEFAULT_SRT_PORT, socket.SOCK_DGRAM)
    domain_held = free_domain() if options.domain is None else nullcontext(options.domain)
    with domain_held as domain:
        directory = Path(tempfile.mkdtemp(prefix="robot-gateway-demo-"))
        ground = Ground(directory, grpc_port, srt_port, domain)
        try:
            _write_configurations(ground, options.source)
            yield ground
        finally:
            _clear(ground)


def _port(options: Options, what: str, given: int | None, usual: int, kind: socket.SocketKind) -> int:
    if given is None and options.any_free_port:
        return free_port(kind)
    port = given or usual
    if port_is_free(kind, port):
        return port
    protocol, option = ("TCP", "--grpc-port") if kind is socket.SOCK_STREAM else ("UDP", "--srt-port")
    raise UserError(
        f"{protocol} port {port}, for {what}, is taken by another program",
        f"Stop that one (ss -{protocol[0].lower()}lnp 'sport = :{port}' names it), "
        f"or choose another port with {option}",
    )


def _write_configurations(ground: Ground, source: Source) -> None:
    gateway = {
        "name": "demo-robot",
        "grpc": {"host": "127.0.0.1", "port": ground.grpc_port},
        "preview": {"socket": str(ground.preview_socket)},
        # Only this machine reaches it.
        "teleop": {"socket": str(ground.drive_socket), "allow_insecure": True, "line_of_sight": True},
    }
    drive = {
        "socket": str(ground.drive_socket),
        "state_dir": str(ground.directory / "drive"),
        "base_timeout_ms": round(TIMEOUT_S * 1000),
    }
    preview = {
        "socket": str(ground.preview_socket),
        "source": source,
        "srt": {"bind": "127.0.0.1", "port": ground.srt_port},
        "runtime_dir": str(ground.directory),
    }
    _write(ground.directory / "gateway.yaml", gateway)
    _write(ground.directory / "preview.yaml", preview)
    _write(ground.directory / "drive.yaml", drive)


def _write(path: Path, values: dict[str, Any]) -> None:
    # JSON is YAML, and needs no library here.
    path.write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")


def _clear(ground: Ground) -> None:
    if not ground.logs_wanted:
        shutil.rmtree(ground.directory)
        return
    for path in ground.directory.iterdir():
        if path.is_dir():
            shutil.rmtree(path)
        elif path not in ground.logs.values():
            path.unlink()
