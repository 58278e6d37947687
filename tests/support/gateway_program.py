"""`robot-gateway serve` as a process of its own, with an operator that is connected to it."""

import json
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import grpc

from bench.video.foreign import end
from omniseer.gateway.v1.robot_gateway_pb2 import GetOverlaySnapshotRequest, GetSystemStatusRequest
from omniseer.gateway.v1.robot_gateway_pb2_grpc import RobotGatewayStub
from tests.support.free import free_tcp_port
from tests.support.restartable_program import RestartableProgram

_ROOT = Path(__file__).parents[2]
_UP_WITHIN_S = 20.0
_MAIN = "from gateway.cli import main; main()"


@dataclass
class RestartableGateway(RestartableProgram):
    """A gateway that is at the same address after each start; `settings` are those besides it."""

    name = "gateway"
    end_within_s = 20

    directory: Path
    settings: Mapping[str, Any]
    port: int = field(default_factory=free_tcp_port)
    process: subprocess.Popen[bytes] | None = None

    @property
    def target(self) -> str:
        return f"127.0.0.1:{self.port}"

    def start(self) -> None:
        """Starts it; it need not answer when this returns."""
        self.spawn((sys.executable, "-c", _MAIN), {"grpc": {"port": self.port}, **self.settings})


@dataclass
class GatewayProgram:
    """A gateway in another process."""

    process: subprocess.Popen[bytes]
    port: int
    stub: Any

    def status(self) -> Any:
        return self.stub.GetSystemStatus(GetSystemStatusRequest(), timeout=5)

    def overlay(self) -> Any:
        return self.stub.GetOverlaySnapshot(GetOverlaySnapshotRequest(), timeout=5)

    def source(self, name: str) -> Any:
        """What the status says of one source."""
        return next(each for each in self.status().sources if each.name == name)


@contextmanager
def gateway_program(
    directory: Path, port: int = 0, first: str = "pass", **settings: Any
) -> Iterator[GatewayProgram]:
    """Up when the block begins, gone when it ends.

    Args:
        directory: for its configuration and log.
        port: without one, any.
        first: what its process executes before the program.
        settings: keys of its configuration.
    """
    port = port or free_tcp_port()
    config = directory / "gateway.yaml"
    values = {"grpc": {"port": port}, "preview": {"socket": str(directory / "preview.sock")}, **settings}
    config.write_text(json.dumps(values), encoding="utf-8")  # JSON is YAML
    command = [sys.executable, "-c", f"{first}; {_MAIN}", "serve", "--config", str(config)]
    with (directory / "gateway.log").open("wb") as log:
        process = subprocess.Popen(command, cwd=_ROOT, stderr=log)
    try:
        # A connection of its own: channels of a process share theirs, and that to an earlier gateway at this
        # port, which was killed, may have stopped trying.
        options = (("grpc.use_local_subchannel_pool", 1),)
        with grpc.insecure_channel(f"127.0.0.1:{port}", options) as channel:
            grpc.channel_ready_future(channel).result(timeout=_UP_WITHIN_S)
            yield GatewayProgram(process, port, RobotGatewayStub(channel))
    except BaseException:
        print((directory / "gateway.log").read_text(encoding="utf-8", errors="replace")[-4000:])
        raise
    finally:
        end(process)
