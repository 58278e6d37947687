"""What the environment can get wrong: one line, no traceback, no ROS half started."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from sensor_msgs.msg import BatteryState

from common.errors import UserError
from gateway.config import DEFAULT_SOURCES
from gateway.ros.intake import intake
from gateway.status.board import Board
from gateway.status.sources import BATTERY, ODOMETRY
from tests.support.free import free_domain
from tests.support.ros import simulated_robot
from tests.support.talker import talking
from tests.support.waiting import wait_until

pytestmark = pytest.mark.ros


@pytest.mark.parametrize("domain", ["abc", "233", "-1", "1.5"])
def test_an_impossible_domain_is_refused(monkeypatch: pytest.MonkeyPatch, domain: str) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", domain)
    with pytest.raises(UserError, match="ROS_DOMAIN_ID"), intake(DEFAULT_SOURCES, Board()):
        pass


@pytest.mark.usefixtures("ros_domain")
def test_reading_ros_touches_nothing_of_the_process() -> None:
    """Signal handlers, rclpy's global context, log files: all as before."""
    program = """
import os, signal, tempfile
os.environ["ROS_LOG_DIR"] = logs = tempfile.mkdtemp()
import rclpy
from tests.support.free import free_domain
from gateway.config import DEFAULT_SOURCES
from gateway.ros.intake import intake
from gateway.status.board import Board
from tests.support.ros import simulated_robot
from tests.support.talker import talking
from tests.support.waiting import wait_until
before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
with intake(DEFAULT_SOURCES, Board()):
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before
    assert not rclpy.ok()
assert os.listdir(logs) == []
print("untouched")
"""
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[4])},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.stdout == "untouched\n", done.stderr


@pytest.mark.usefixtures("ros_domain")
@pytest.mark.parametrize(
    "command",
    [
        "from gateway.cli import main; main()",
        "from simrobot.cli import main; main()",
    ],
)
@pytest.mark.parametrize("middleware", ["rmw_that_is_not_there", "../etc"])
def test_a_middleware_that_is_not_installed_is_refused_in_one_line(
    tmp_path: Path, command: str, middleware: str
) -> None:
    """Left to itself, rclpy would end the process with a status of its own, in the middle of an import."""
    done = subprocess.run(
        [sys.executable, "-c", command, "serve" if "gateway" in command else "run"],
        env=os.environ
        | {
            "PYTHONPATH": str(Path(__file__).parents[4]),
            "RMW_IMPLEMENTATION": middleware,
            "GATEWAY__GRPC__PORT": "0",
            "GATEWAY__PREVIEW__SOCKET": str(tmp_path / "preview.sock"),
        },
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    lines = [line for line in done.stderr.splitlines() if "INFO" not in line]
    assert len(lines) == 1
    assert f"RMW_IMPLEMENTATION is '{middleware}'" in lines[0]
    assert "Unset it" in lines[0]


@pytest.mark.usefixtures("ros_domain")
def test_the_middleware_can_be_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The one that is installed, in this process and in the robot's."""
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp")
    board = Board()
    with intake(DEFAULT_SOURCES, board), simulated_robot(tmp_path):
        wait_until(lambda: board[ODOMETRY], "odometry")


def test_robots_of_other_domains_are_not_heard(ros_domain: int, tmp_path: Path) -> None:
    board = Board()
    with free_domain() as other, pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(other))
        with simulated_robot(tmp_path):
            patch.setenv("ROS_DOMAIN_ID", str(ros_domain))
            with intake(DEFAULT_SOURCES, board), talking() as talker:
                talker.publisher("/battery", BatteryState)
                wait_until(
                    lambda: (
                        (seen := board.publishers.get(BATTERY))
                        and seen.count == 1
                        and talker.publisher("/battery", BatteryState).publish(BatteryState()) is None
                        and board[BATTERY]
                    ),
                    "the talker of this domain alone",
                )
                assert board[ODOMETRY] is None
                assert board.publishers[ODOMETRY].count == 0
