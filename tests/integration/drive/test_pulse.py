"""`robot-drive doctor --pulse`: that it is left out, what ends it, and that its last word is zero."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
import pytest

from common.ros_node import message_class, ros_node
from tests.integration.drive.test_commands import findings
from tests.support.driving import Driving
from tests.support.promise import MS, keeps
from tests.support.undisturbed import DisturbedError, undisturbed
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.timed]

END_S = 60
SILENT_NS = 100_000_000
LATE = "its process was silent for"
"""Of a pulse whose process the machine has held up for 250 ms, which ends it."""


@contextmanager
def doctor(robot: Driving, config: Path | None = None) -> Iterator["subprocess.Popen[str]"]:
    """The doctor, on its way to a pulse; with a configuration of its own if need be."""
    command = [sys.executable, "-m", "tests.support.unseeing_doctor", "doctor", "--pulse", "--json"]
    command += ["--config", str(config or robot.directory / "drive.yaml")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def found(process: "subprocess.Popen[str]") -> str:
    """What the doctor says of the pulse.

    Raises:
        DisturbedError: it was late itself.
    """
    output, _ = process.communicate(timeout=END_S)
    done = subprocess.CompletedProcess(process.args, process.returncode, output)
    what = findings(done)["pulse"]["what"]
    if LATE in what:
        raise DisturbedError(what)
    return what


def wait_for_motion(
    robot: Driving, process: "subprocess.Popen[str]", meanwhile: Callable[[], None] = lambda: None
) -> None:
    """Waits until the pulse moves the robot. The newest message of an earlier attempt may be motion."""
    began_ns = time.monotonic_ns()

    def begun() -> bool:
        meanwhile()
        moved = moved_since(robot, began_ns) and robot.witness.moves()
        return moved or process.poll() is not None

    wait_until(begun, "the pulse", END_S)
    assert process.poll() is None, f"it has ended: {found(process)}"


def moved_since(robot: Driving, since_ns: int) -> bool:
    return bool(robot.witness.motion_since(since_ns))


def test_driving_that_is_disabled_forbids_it(robot: Driving) -> None:
    robot.ready().send(enabled=False)
    robot.phase_is("DISABLED")
    began_ns = time.monotonic_ns()
    with doctor(robot) as process:
        assert found(process) == "the pulse was left out: driving is disabled"
    assert not moved_since(robot, began_ns)


def test_the_robots_own_stop_ends_it(robot: Driving, tmp_path: Path) -> None:
    boolean = message_class("std_msgs/msg/Bool")
    config = tmp_path / "drive.yaml"
    values = json.loads((robot.directory / "drive.yaml").read_text(encoding="utf-8"))
    config.write_text(json.dumps(values | {"stop_topics": ["/stop_button"]}), encoding="utf-8")
    with ros_node("button") as button:
        publisher = button.create_publisher(boolean, "/stop_button", 1)

        def ended() -> None:
            robot.ready()
            with doctor(robot, config) as process:
                wait_for_motion(robot, process, lambda: publisher.publish(boolean(data=False)))
                publisher.publish(boolean(data=True))
                assert "ended early: the robot's own stop is active" in found(process)
            robot.settled()
            assert not robot.witness.moves()

        undisturbed(ended)


def test_a_stop_ends_it(robot: Driving) -> None:
    def stop() -> float:
        peer = robot.ready()
        with doctor(robot) as process:
            wait_for_motion(robot, process)
            began_ns = time.monotonic_ns()
            peer.send(stop="ben")
            assert found(process) == "the pulse was ended early: the robot was stopped by ben"
        robot.settled()
        return robot.witness.zero_after_ms(began_ns)

    keeps(50, "stop in a pulse, ms", stop, per_stalled_s=MS)


def test_a_driver_ends_it(robot: Driving) -> None:
    def ended() -> None:
        peer = robot.ready()
        with doctor(robot) as process:
            wait_for_motion(robot, process)
            peer.send(lease="anna", held=False)
            assert found(process) == "the pulse was ended early: a driver has the robot"
        robot.settled()
        assert not robot.witness.moves()

    undisturbed(ended)


@pytest.mark.parametrize(
    ("who", "number", "moment"),
    [
        ("doctor", signal.SIGKILL, "in motion"),
        ("doctor", signal.SIGKILL, "in silence"),
        ("doctor", signal.SIGSTOP, "in motion"),
        ("doctor", signal.SIGHUP, "in motion"),
        ("pulse", signal.SIGKILL, "in motion"),
        ("pulse", signal.SIGSTOP, "in motion"),
    ],
)
def test_whatever_ends_it_the_last_message_is_zero(
    robot: Driving, who: str, number: signal.Signals, moment: str
) -> None:
    """The other signals that end the doctor in order: tests/unit/drive/test_doctors_signals.py."""

    def ended() -> None:
        robot.ready()
        with doctor(robot) as process:
            wait_for_motion(robot, process)
            if moment == "in silence":
                wait_until(lambda: time.monotonic_ns() - robot.witness.seen[-1][0] > SILENT_NS, "the silence")
                assert robot.witness.moves(), found(process)
            (pulse,) = psutil.Process(process.pid).children()
            os.kill(process.pid if who == "doctor" else pulse.pid, number)
            wait_until(lambda: not robot.witness.moves(), "zero", 5)
            robot.settled()
            assert not robot.witness.moves()
            if (who, number) == ("doctor", signal.SIGHUP):
                assert process.wait(END_S) >= 0, "no signal has ended it before the pulse"
            process.kill()
        psutil.wait_procs([pulse], timeout=END_S)

    undisturbed(ended)
