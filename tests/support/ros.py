"""ROS 2 for tests: a domain of their own, a simulated robot in another process. Needs no rclpy by itself."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from bench.video.foreign import end
from common import ros_transport
from simrobot.control import ask
from tests.support.free import free_domain

_ROOT = Path(__file__).parents[2]


@pytest.fixture
def ros_domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A domain of this test's own, in force for this process and its children; nothing leaves the machine.

    Our programs use UDP, as the containers and the systemd units have them do: through the shared memory a
    gateway that takes the place of a killed one may hear nothing (`common.ros_transport`).
    """
    with _own_domain(monkeypatch) as domain:
        yield domain


@pytest.fixture(scope="module")
def module_ros_domain() -> Iterator[int]:
    """The same for the tests of a module that share a robot."""
    with pytest.MonkeyPatch.context() as patch, _own_domain(patch) as domain:
        yield domain


@contextmanager
def _own_domain(patch: pytest.MonkeyPatch) -> Iterator[int]:
    with free_domain() as domain:
        patch.setenv("ROS_DOMAIN_ID", str(domain))
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        patch.setenv(ros_transport.VARIABLE, "udp")
        yield domain


@dataclass
class SimulatedRobot:
    """A robot in another process."""

    process: subprocess.Popen[str]
    control: Path

    def change(self, **desired: Any) -> dict[str, Any]:
        """Changes its behaviour."""
        return ask(self.control, desired)


@contextmanager
def simulated_robot(directory: Path, *arguments: str) -> Iterator[SimulatedRobot]:
    """`simrobot run` with these arguments in the domain of the environment; ready when the block begins."""
    control = directory / "robot.sock"
    command = [
        sys.executable,
        "-c",
        "from simrobot.cli import main; main()",
        "run",
        "--control",
        str(control),
    ]
    process = subprocess.Popen([*command, *arguments], stdout=subprocess.PIPE, text=True, cwd=_ROOT)
    try:
        assert process.stdout
        line = process.stdout.readline()
        assert "ready" in line, f"the simulated robot ended early: {line!r}"
        yield SimulatedRobot(process, control)
    finally:
        end(process)
        if process.stdout:
            process.stdout.close()
