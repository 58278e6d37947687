"""The simulated robot as a program: its command line, its control socket, its end."""

import os
import subprocess
import sys
import time
from pathlib import Path
from tempfile import mkdtemp

import pytest

from common.errors import UserError
from gateway.config import DEFAULT_SOURCES, SourceSettings
from gateway.ros.intake import intake
from gateway.status.board import Board
from gateway.status.sources import (
    BATTERY,
    DETECTIONS,
    DIAGNOSTICS,
    EFFECTIVE_COMMAND,
    MODE,
    MUX_INPUTS,
    ODOMETRY,
    VISION,
)
from gateway.status.values import CommandSource, DiagnosticLevel
from tests.support.boards import has_all, newest
from tests.support.promise import keeps
from tests.support.ros import simulated_robot
from tests.support.waiting import wait_until

pytestmark = pytest.mark.ros

SIMROBOT = [sys.executable, "-c", "from simrobot.cli import main; main()"]


def spoken(board: Board) -> set[CommandSource]:
    """The mux inputs with a command."""
    return {source for source, spec in MUX_INPUTS.items() if board[spec]}


def simrobot(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*SIMROBOT, *arguments],
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[3])} | environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


@pytest.mark.usefixtures("ros_domain")
def test_its_topics_are_the_gateways_default_sources(tmp_path: Path) -> None:
    board = Board()
    with intake(DEFAULT_SOURCES, board), simulated_robot(tmp_path, "battery_percent=40", "speed_mps=0.75"):
        wait_until(lambda: has_all(board, ODOMETRY, VISION, DETECTIONS, BATTERY), "all sensors")
        wait_until(lambda: has_all(board, DIAGNOSTICS, EFFECTIVE_COMMAND) and spoken(board), "the rest")
    assert not board.unusable
    assert spoken(board) == {CommandSource.AUTONOMY}, "the others are there, and do not speak"
    assert newest(board, ODOMETRY).value.vx_mps == 0.75
    assert newest(board, BATTERY).value.charge_percent == pytest.approx(40, abs=1)
    assert newest(board, DETECTIONS).value.count == 3


@pytest.mark.usefixtures("ros_domain")
def test_faults_come_and_go_while_it_runs(tmp_path: Path) -> None:
    board = Board()
    with intake(DEFAULT_SOURCES, board), simulated_robot(tmp_path) as robot:
        robot.change(battery_percent=7, infer_errors_per_s=50, detection_count=250, speed_mps=-1.25)
        wait_until(lambda: (now := board[ODOMETRY]) and now.value.vx_mps == -1.25, "the new speed")
        wait_until(lambda: (now := board[VISION]) and now.value.infer_error_count > 10, "inference errors")
        found = wait_until(
            lambda: now if (now := board[DETECTIONS]) and now.value.count == 250 else None,
            "many boxes",
        )
        assert len(found.value.items) == 100
        wait_until(
            lambda: (
                (now := board[BATTERY])
                and now.value.charge_percent is not None
                and now.value.charge_percent < 8
            ),
            "a low battery",
        )
        robot.change(not_a_number=["battery", "detections"])
        wait_until(
            lambda: newest(board, BATTERY).value.charge_percent is None,
            "a charge that is not known",
        )
        wait_until(lambda: not newest(board, DETECTIONS).value.items, "no box to draw")


@pytest.mark.usefixtures("ros_domain")
def test_drivers_components_and_modes_change_while_it_runs(tmp_path: Path) -> None:
    board = Board()
    mode = SourceSettings(
        kind="mode",
        topic="/mission/mode",
        type="std_msgs/msg/String",
        stale_after_ms=1000,
        reliability="reliable",
        durability="transient_local",
    )

    def levels() -> dict[str, DiagnosticLevel]:
        received = board[DIAGNOSTICS]
        items = received.value.items if received else ()
        return {item.component.partition(":")[0]: item.level for item in items}

    with simulated_robot(tmp_path, "mode=idle") as robot, intake((*DEFAULT_SOURCES, mode), board):
        wait_until(
            lambda: (now := board[MODE]) and now.value.name == "idle", "the mode from before the gateway"
        )
        robot.change(commander="keyboard", mode="returning", components={"drive": "error", "lidar": "stale"})
        wait_until(lambda: CommandSource.KEYBOARD in spoken(board), "the keyboard's commands")
        wait_until(lambda: newest(board, MODE).value.name == "returning", "the new mode")
        wait_until(
            lambda: (
                levels()
                == {
                    "drive": DiagnosticLevel.ERROR,
                    "power": DiagnosticLevel.OK,
                    "vision": DiagnosticLevel.OK,
                    "lidar": DiagnosticLevel.STALE,
                }
            ),
            "the components' levels",
        )


@pytest.mark.timed
@pytest.mark.usefixtures("ros_domain")
def test_it_ends_within_two_seconds_of_sigterm(tmp_path: Path) -> None:
    def took_s() -> float:
        with simulated_robot(Path(mkdtemp(dir=tmp_path))) as robot:
            asked_s = time.monotonic()
            robot.process.terminate()
            assert robot.process.wait(30) == 0
            ended_s = time.monotonic()
            assert not robot.control.exists()
        return ended_s - asked_s

    keeps(2.0, "s from SIGTERM to the end", took_s)


@pytest.mark.usefixtures("ros_domain")
def test_control_speaks_to_a_running_robot(tmp_path: Path) -> None:
    with simulated_robot(tmp_path) as robot:
        at = ("--control", str(robot.control))
        assert '"odometry"' in simrobot("control", *at, "silence", "odometry", "battery").stdout
        assert set(robot.change()["silent"]) == {"battery", "odometry"}
        for action in ("silence", "resume", "set"):
            without = simrobot("control", *at, action)
            assert without.returncode == 2
            assert "needs at least one" in without.stderr
        assert simrobot("control", *at, "resume", "odometry").returncode == 0
        assert robot.change()["silent"] == ["battery"]
        changed = simrobot("control", *at, "set", "speed_mps=2.5", "components=drive:error,lidar:stale")
        assert changed.returncode == 0, changed.stderr
        assert robot.change()["speed_mps"] == 2.5
        assert robot.change()["components"] == {"drive": "error", "lidar": "stale"}
        with pytest.raises(UserError, match="silent"):
            robot.change(silent=["sonar"])


@pytest.mark.usefixtures("ros_domain")
@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("run", "speed_mps=fast"), 2, "speed_mps"),
        (("run", "wings=2"), 2, "wings"),
        (("run", "--control", "/nonexistent/robot.sock"), 1, "/nonexistent/robot.sock"),
        (("control", "--control", "/nonexistent/robot.sock", "show"), 3, "no simulated robot answers"),
    ],
)
def test_a_mistake_is_one_line(arguments: tuple[str, ...], code: int, said: str) -> None:
    done = simrobot(*arguments)
    assert done.returncode == code, done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.usefixtures("ros_domain")
def test_without_its_message_packages_it_says_what_to_type(tmp_path: Path) -> None:
    """A package of the same name that has nothing in it stands in the way of the real one."""
    (tmp_path / "omniseer_msgs").mkdir()
    (tmp_path / "omniseer_msgs" / "__init__.py").touch()
    root = Path(__file__).parents[3]
    done = simrobot("run", PYTHONPATH=f"{tmp_path}:{root}")
    assert done.returncode == 1
    assert "omniseer_msgs" in done.stderr
    assert "scripts/setup" in done.stderr
    assert "Traceback" not in done.stderr
