"""robot-drive on the command line, against a real graph."""

import json
import os
import subprocess
import sys
import time

import pytest

from tests.support.driving import Driving
from tests.support.undisturbed import no_stall, undisturbed

pytestmark = [pytest.mark.ros, pytest.mark.timed]


def robot_drive(*words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return run("drive.cli", *words, **environment)


def health(**environment: str) -> subprocess.CompletedProcess[str]:
    return run("drive.health", **environment)


def run(module: str, *words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", module, *words],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def findings(done: subprocess.CompletedProcess[str]) -> dict[str, dict[str, str]]:
    return {each["check"]: each for each in json.loads(done.stdout)["findings"]}


@pytest.mark.timeout(300)
def test_the_doctor_finds_mux_base_and_timeout_and_measures_what_a_pulse_does(robot: Driving) -> None:
    config = str(robot.directory / "drive.yaml")

    def examined() -> subprocess.CompletedProcess[str]:
        robot.ready()
        # A pulse whose process is held up for 250 ms ends itself.
        with no_stall():
            done = robot_drive("doctor", "--config", config, "--pulse", "--json")
            assert done.returncode == 0, done.stdout + done.stderr
            pulsed = findings(done)
            assert pulsed["pulse"]["verdict"] == "good"
            measured_s = float(pulsed["pulse.timeout"]["what"].split()[3])
            assert 0.9 <= measured_s <= 1.5
            robot.settled()
            assert not robot.witness.moves(), "it ends with a zero"
        return done

    found = findings(undisturbed(examined))
    assert "twist_mux" in found["mux/cmd_vel_keyboard"]["what"]
    ranks = {
        name: (found[name]["verdict"], found[name]["what"]) for name in ("mux.priority", "mux.lock.priority")
    }
    assert ranks == {
        "mux.priority": (
            "good",
            "/cmd_vel_keyboard (priority 3) has the highest priority of the multiplexer's inputs",
        ),
        "mux.lock.priority": (
            "good",
            "the lock on /cmd_vel_emergency_stop (priority 255) ranks above the inputs of others",
        ),
    }
    assert "mecanum_drive_controller" in found["base"]["what"]
    assert "stops 1 s after" in found["base.timeout"]["what"]


def test_the_doctor_moves_nothing_while_a_driver_has_the_robot(robot: Driving) -> None:
    robot.drive(vx=0.1)
    since_ns = time.monotonic_ns()
    config = str(robot.directory / "drive.yaml")
    done = run("tests.support.unseeing_doctor", "doctor", "--config", config, "--pulse", "--json")
    assert "left out" in findings(done)["pulse"]["what"]
    seen = {round(speed, 6) for seen_ns, speed in robot.witness.seen if seen_ns >= since_ns}
    assert seen
    assert seen <= {0.0, 0.1}, "what the driver does, and nothing else"


def test_the_health_check_follows_the_program(robot: Driving) -> None:
    robot.ready()
    config = str(robot.directory / "drive.yaml")
    healthy = health(ROBOT_DRIVE_CONFIG=config)
    assert (healthy.returncode, healthy.stdout.split()[-1]) == (0, "available")
    gone = health(DRIVE__SOCKET="/nonexistent/x")
    assert gone.returncode == 1
    assert "no drive program answers" in gone.stderr
