"""Robots of other machines are not heard in LOCALHOST, as compose.yaml sets it; a namespace is one here."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(
        os.geteuid() != 0 or shutil.which("ip") is None, reason="network namespaces need root"
    ),
]

SUBNET = "10.213.77"
PATIENCE_S = 30.0
LONGER = 3.0
"""How many times as long as it takes to hear the other machine where that is permitted."""


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True, text=True)


@contextmanager
def other_machine() -> Iterator[str]:
    """A namespace with a cable to this machine; its name."""
    name = f"rg-{os.getpid()}"
    ours, theirs = f"rg{os.getpid()}a", f"rg{os.getpid()}b"
    with ExitStack() as stack:
        ip("netns", "add", name)
        stack.callback(ip, "netns", "delete", name)  # and the cable with it
        ip("link", "add", ours, "type", "veth", "peer", "name", theirs, "netns", name)
        ip("address", "add", f"{SUBNET}.1/24", "dev", ours)
        ip("link", "set", ours, "up")
        for words in (
            ("address", "add", f"{SUBNET}.2/24", "dev", theirs),
            ("link", "set", theirs, "up"),
            ("link", "set", "lo", "up"),
            ("route", "add", "default", "via", f"{SUBNET}.1"),
        ):
            ip("-n", name, *words)
        yield name


@contextmanager
def robot_of(namespace: str, directory: Path) -> Iterator[None]:
    """A robot there that any machine may hear."""
    program = "from simrobot.cli import main; main()"
    words = [sys.executable, "-c", program, "run", "--control", str(directory / "robot.sock")]
    environment = os.environ | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    with subprocess.Popen(
        ["ip", "netns", "exec", namespace, *words], stdout=subprocess.PIPE, text=True, env=environment
    ) as process:
        try:
            assert process.stdout
            assert "ready" in process.stdout.readline()
            yield
        finally:
            process.terminate()


def heard(discovery: str, within_s: float) -> float | None:
    """Returns after how many seconds a gateway here hears the robot; None if it does not."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.support.hearing", str(within_s)],
        env=os.environ | {"ROS_AUTOMATIC_DISCOVERY_RANGE": discovery},
        capture_output=True,
        text=True,
        check=True,
    )
    said = done.stdout.split()[-1]
    return None if said == "silent" else float(said)


@pytest.mark.usefixtures("ros_domain")
def test_a_robot_of_another_machine_is_not_heard(tmp_path: Path) -> None:
    with other_machine() as namespace, robot_of(namespace, tmp_path):
        took_s = heard("SUBNET", PATIENCE_S)
        assert took_s is not None, "it is heard where that is permitted"
        assert heard("LOCALHOST", LONGER * took_s) is None
