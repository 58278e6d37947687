"""What the environment can get wrong: one line, no traceback, no ROS half started."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from common.errors import UserError
from gateway.config import DEFAULT_SOURCES
from gateway.ros.intake import intake
from gateway.status.board import Board

pytestmark = pytest.mark.ros


@pytest.mark.parametrize("domain", ["abc", "233", "-1", "1.5"])
def test_an_impossible_domain_is_refused(monkeypatch: pytest.MonkeyPatch, domain: str) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", domain)
    with pytest.raises(UserError, match="ROS_DOMAIN_ID"), intake(DEFAULT_SOURCES, Board()):
        pass


def test_reading_ros_touches_nothing_of_the_process(ros_domain: int) -> None:
    """Signal handlers, rclpy's global context, log files: all as before."""
    program = """
import os, signal, tempfile
os.environ["ROS_LOG_DIR"] = logs = tempfile.mkdtemp()
import rclpy
from gateway.config import DEFAULT_SOURCES
from gateway.ros.intake import intake
from gateway.status.board import Board
before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
with intake(DEFAULT_SOURCES, Board()):
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before
    assert not rclpy.ok()
assert os.listdir(logs) == []
print("untouched")
"""
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[3])},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.stdout == "untouched\n", done.stderr
