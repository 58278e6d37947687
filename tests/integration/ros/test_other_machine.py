"""Robots of other machines are not heard in LOCALHOST, as compose.yaml sets it; a namespace is one here."""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from gateway.config import DEFAULT_SOURCES
from gateway.ros.intake import intake
from gateway.status.board import Board
from gateway.status.sources import ODOMETRY
from tests.support.waiting import wait_until

pytestmark = [
    pytest.mark.ros,
    # Alone: beside running containers, whose bridges are interfaces of this machine, it is not heard at all.
    pytest.mark.timed,
    pytest.mark.skipif(
        os.geteuid() != 0 or shutil.which("ip") is None, reason="network namespaces need root"
    ),
]

SUBNET = "10.213.77"
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


@pytest.mark.usefixtures("ros_domain")
def test_a_robot_of_another_machine_is_not_heard(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with other_machine() as namespace, robot_of(namespace, tmp_path):
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
        board, began_s = Board(), time.monotonic()
        with intake(DEFAULT_SOURCES, board):
            wait_until(lambda: heard(board), "it is heard where that is permitted", 20)
        took_s = time.monotonic() - began_s
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        board = Board()
        with intake(DEFAULT_SOURCES, board), pytest.raises(AssertionError, match="it is heard"):
            wait_until(lambda: heard(board), "it is heard", LONGER * took_s)


def heard(board: Board) -> bool:
    return board[ODOMETRY] is not None
