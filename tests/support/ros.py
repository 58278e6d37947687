"""ROS 2 for tests: a domain of their own, a simulated robot in another process. Needs no rclpy by itself."""

import fcntl
import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from simrobot.control import ask

# Beyond 101 the ports of a domain reach into the range that Linux hands out to anybody.
_DOMAINS = range(1, 102)
_ROOT = Path(__file__).parents[2]


@contextmanager
def free_domain() -> Iterator[int]:
    """A ROS domain that no other test and no running program uses, until the block ends."""
    locks = Path(tempfile.gettempdir()) / f"robot-gateway-ros-domains-{os.getuid()}"
    locks.mkdir(exist_ok=True)
    first = os.getpid() % len(_DOMAINS)
    for domain in (*_DOMAINS[first:], *_DOMAINS[:first]):
        with (locks / str(domain)).open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            if _is_silent(domain):
                yield domain
                return
    raise RuntimeError("all ROS domains are in use")


def _is_silent(domain: int) -> bool:
    """Whether no participant listens on the domain's discovery port (RTPS: 7400 + 250 x domain)."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", 7400 + 250 * domain))
        except OSError:
            return False
    return True


@pytest.fixture
def ros_domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A domain of this test's own, in force for this process and its children; nothing leaves the machine."""
    with free_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        yield domain


@dataclass
class SimulatedRobot:
    """A robot in another process."""

    process: subprocess.Popen[str]
    control: Path

    def change(self, **wish: Any) -> dict[str, Any]:
        """Changes its behaviour."""
        return ask(self.control, wish)


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
        process.terminate()
        with suppress(subprocess.TimeoutExpired):
            process.wait(5)
        process.kill()
        process.wait()
        if process.stdout:
            process.stdout.close()
