"""A robot as operators meet it: simulated sensors, the real gateway and preview service; each may die."""

import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from tests.support.gateway_program import RestartableGateway
from tests.support.ros import SimulatedRobot, simulated_robot
from tests.support.running_preview import RunningPreview
from tests.support.waiting import wait_until

_UP_WITHIN_S = 20.0


@dataclass
class WholeRobot:
    """Three programs.

    Args:
        sensors: what publishes; the ROS domain is the environment's.
        preview: what makes the video.
        gateway: what operators speak to.
    """

    sensors: SimulatedRobot
    preview: RunningPreview
    gateway: RestartableGateway

    @property
    def target(self) -> str:
        """The gateway's address."""
        return self.gateway.target

    def start_gateway(self) -> None:
        """Up when this returns."""
        self.gateway.start()
        wait_until(self._listens, "the gateway listens", _UP_WITHIN_S)

    def kill_preview(self) -> None:
        """The video's program dies without a word."""
        self.preview.process.kill()
        self.preview.process.wait()

    def _listens(self) -> bool:
        with socket.socket() as probe, suppress(ConnectionRefusedError):
            probe.connect(("127.0.0.1", self.gateway.port))
            return True
        return False


@contextmanager
def whole_robot(directory: Path) -> Iterator[WholeRobot]:
    """Up when the block begins; nothing is left when it ends."""
    with ExitStack() as stack:
        sensors = stack.enter_context(simulated_robot(directory))
        preview = stack.enter_context(RunningPreview(directory, small=False))
        settings = {"name": "lab-1", "preview": {"socket": str(preview.socket)}}
        robot = WholeRobot(sensors, preview, RestartableGateway(directory, settings))
        stack.callback(robot.gateway.kill)
        robot.start_gateway()
        yield robot
