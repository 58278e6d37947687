"""Programs that run as another user than the tests do, as the robot's own nodes do beside the containers."""

import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import pytest

_ROOT: Final = Path(__file__).parents[2]
GATEWAY: Final = (10001, 10000)
"""User and group of the gateway in its container (docker/gateway.Dockerfile)."""
ORDINARY: Final = (1000, 1000)
"""The first ordinary user of a robot; root has rights that hide half of the fault."""


@contextmanager
def directory_of(user: tuple[int, int]) -> Iterator[Path]:
    """Yields a new directory of this user; pytest's own are closed to others."""
    with TemporaryDirectory(prefix="other-user-") as path:
        os.chown(path, *user)
        yield Path(path)


@contextmanager
def running_as(
    user: tuple[int, int], home: Path, *command: str, environment: Mapping[str, str] | None = None
) -> Iterator[subprocess.Popen[str]]:
    """Runs `python COMMAND` as a user without other groups, until the block ends; skips where it can't be.

    Args:
        user: and its group, by number; neither needs an entry in /etc/passwd.
        home: where it may write.
        command: for this Python.
        environment: what differs from that of the test.
    """
    if os.geteuid() != 0:
        pytest.skip("only root can run a program as another user")
    reads = subprocess.run(
        [sys.executable, "-c", "import common.ros_node"],
        cwd=_ROOT,
        capture_output=True,
        user=user[0],
        group=user[1],
        extra_groups=[],
        timeout=60,
        check=False,
    )
    if reads.returncode:
        pytest.skip(f"user {user[0]} can't read this checkout: {reads.stderr.decode().strip()[-200:]}")
    process = subprocess.Popen(
        [sys.executable, *command],
        cwd=_ROOT,
        env={**os.environ, "HOME": str(home), **(environment or {})},
        stdout=subprocess.PIPE,
        text=True,
        user=user[0],
        group=user[1],
        extra_groups=[],
    )
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.communicate(timeout=15)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


@contextmanager
def simulated_robot_as(user: tuple[int, int]) -> Iterator[None]:
    """`simrobot run` as this user in the domain of the environment; it publishes when the block begins."""
    with directory_of(user) as home:
        command = (
            "-c",
            "from simrobot.cli import main; main()",
            "run",
            "--control",
            str(home / "robot.sock"),
        )
        with running_as(user, home, *command) as process:
            assert process.stdout
            assert "ready" in process.stdout.readline(), "the simulated robot ended early"
            yield
