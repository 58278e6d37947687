"""A robot as operators meet it: simulated sensors, the real gateway and preview service; each may die."""

import json
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from tests.support.free import free_tcp_port
from tests.support.ros import SimulatedRobot, simulated_robot
from tests.support.running_preview import RunningPreview
from tests.support.waiting import wait_until

_ROOT = Path(__file__).parents[2]
_UP_WITHIN_S = 20.0


@dataclass
class WholeRobot:
    """Three programs.

    Args:
        sensors: what publishes; the ROS domain is the environment's.
        preview: what makes the video.
        directory: for the gateway's configuration and log.
    """

    sensors: SimulatedRobot
    preview: RunningPreview
    directory: Path
    port: int = field(default_factory=free_tcp_port)
    gateway: "subprocess.Popen[bytes] | None" = None

    @property
    def target(self) -> str:
        """The gateway's address."""
        return f"127.0.0.1:{self.port}"

    def start_gateway(self) -> None:
        """Up when this returns; at the same address every time."""
        config = self.directory / "gateway.yaml"
        values = {
            "name": "lab-1",
            "grpc": {"port": self.port},
            "preview": {"socket": str(self.preview.socket)},
        }
        config.write_text(json.dumps(values), encoding="utf-8")  # JSON is YAML
        program = [sys.executable, "-c", "from gateway.cli import main; main()"]
        command = [*program, "serve", "--config", str(config)]
        with (self.directory / "gateway.log").open("ab") as log:
            self.gateway = subprocess.Popen(command, cwd=_ROOT, stderr=log)
        wait_until(self._listens, "the gateway listens", _UP_WITHIN_S)

    def kill_gateway(self) -> None:
        """As if somebody had pulled the plug."""
        if self.gateway:
            self.gateway.kill()
            self.gateway.wait()

    def kill_preview(self) -> None:
        """The video's program dies without a word."""
        self.preview.process.kill()
        self.preview.process.wait()

    def _listens(self) -> bool:
        with socket.socket() as probe, suppress(ConnectionRefusedError):
            probe.connect(("127.0.0.1", self.port))
            return True
        return False


@contextmanager
def whole_robot(directory: Path) -> Iterator[WholeRobot]:
    """Up when the block begins; nothing is left when it ends."""
    with ExitStack() as stack:
        sensors = stack.enter_context(simulated_robot(directory))
        preview = stack.enter_context(RunningPreview(directory, small=False))
        robot = WholeRobot(sensors, preview, directory)
        stack.callback(robot.kill_gateway)
        robot.start_gateway()
        yield robot
