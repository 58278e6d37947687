"""A robot without Docker, under a real systemd: its programs run, are confined, and come back."""

import json
import os
from collections.abc import Iterator

import pytest

from tests.support.systemd_robot import SystemdRobot, build_image, running_robot
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.on_request, pytest.mark.docker, pytest.mark.timeout(900)]

PROGRAMS = ("gateway", "preview", "drive", "recorder", "bridge", "tap")
SOCKETS = {
    "preview": "/run/robot-gateway/preview.sock",
    "tap": "/run/robot-video/tap.sock",
    "drive": "/run/robot-drive/drive.sock",
    "recorder": "/run/robot-recorder/recorder.sock",
    "bridge": "/run/robot-bridge/bridge.sock",
    "camera tap": "/run/robot-tap/tap.sock",
}
CONNECTS = {
    "gateway": {"preview", "drive", "recorder", "bridge"},
    "preview": {"preview", "tap", "camera tap"},
    "drive": {"drive"},
    "recorder": {"recorder", "tap"},
    "bridge": {"bridge"},
    "tap": {"camera tap"},
}
"""Who may connect to which socket: who listens there, and whose container has its volume."""
GATEWAY = """
teleop: {socket: /run/robot-drive/drive.sock, allow_insecure: true}
recording: {socket: /run/robot-recorder/recorder.sock}
bridge: {socket: /run/robot-bridge/bridge.sock}
"""
BIN = "/opt/robot-gateway/current/bin"
# Ten seconds of silence, two for the abort, one until the restart, and the start on a busy machine.
FROZEN_BACK_WITHIN_S = 45


@pytest.fixture(scope="module")
def robot() -> Iterator[SystemdRobot]:
    """With all six programs, and simulated sensors and wheels."""
    build_image()
    with running_robot(f"robot-systemd-{os.getpid()}") as robot:
        robot.run(
            *(
                "systemd-run",
                "--quiet",
                "--unit=simrobot",
                "--property=DynamicUser=yes",
                "--setenv=ROS_DOMAIN_ID=0",
            ),
            *(
                "--setenv=ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST",
                "--setenv=RMW_IMPLEMENTATION=rmw_fastrtps_cpp",
            ),
            *(f"{BIN}/simrobot", "run", "--base", "--control=/tmp/simrobot.sock"),
        )
        config = robot.output("cat", "/etc/robot-gateway/gateway.yaml")
        robot.write("/etc/robot-gateway/gateway.yaml", config + GATEWAY)
        robot.write("/etc/robot-gateway/recorder.yaml", "room: {min_free_bytes: 0}\n")
        robot.run(
            "systemctl", "enable", "--now", "robot-drive", "robot-recorder", "robot-bridge", "robot-tap"
        )
        robot.run("systemctl", "restart", "robot-gateway")
        for program in PROGRAMS:
            robot.wait_active(program)
        yield robot


def test_all_programs_serve_and_the_gateway_reaches_them(robot: SystemdRobot) -> None:
    def sees_it_move() -> bool:
        odometry = robot.robotctl("status")["odometry"]
        return odometry["available"] and not odometry["stale"]

    # From a node of another user, as the robot's own nodes are.
    wait_until(sees_it_move, "odometry of the simulated robot", 40)
    for part in ("preview", "drive", "recorder", "bridge"):
        robot.run(f"{BIN}/python", "-m", "common.healthcheck", "127.0.0.1:50051", part)


def test_the_preview_encodes_and_the_recorder_gets_its_video(robot: SystemdRobot) -> None:
    robot.run(f"{BIN}/robotctl", "preview", "on")
    try:
        wait_until(
            lambda: robot.robotctl("status")["preview"]["state"].upper().endswith("RUNNING"),
            "the preview runs",
            30,
        )
        robot.run(f"{BIN}/robotctl", "record", "start")
    finally:
        robot.run(f"{BIN}/robotctl", "record", "stop", check=False)
        robot.run(f"{BIN}/robotctl", "preview", "off")
    listed = robot.output("find", "/var/lib/robot-recorder", "-name", "*.mcap", "-size", "+0")
    assert listed


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_process_is_an_ordinary_user_without_privileges(robot: SystemdRobot, program: str) -> None:
    user = robot.output("id", "-u", f"robot-{program}").strip()
    found = robot.output("ps", "-o", "pid=", "-u", user).split()
    assert str(robot.pid(program)) in found
    for pid in found:
        fields = robot.status_of(int(pid))
        assert set(fields["Uid"].split()) == {user}
        for kind in ("CapInh", "CapPrm", "CapEff", "CapBnd", "CapAmb"):
            assert int(fields[kind], 16) == 0, f"{program}: {kind} {fields[kind]}"
        assert fields["NoNewPrivs"] == "1"
        assert fields["Seccomp"] == "2"


CONNECT = """
import socket, sys
for kind in (socket.SOCK_STREAM, socket.SOCK_SEQPACKET):
    try:
        socket.socket(socket.AF_UNIX, kind).connect(sys.argv[1])
    except PermissionError:
        sys.exit(13)
    except OSError as error:
        if error.errno != 91:  # EPROTOTYPE
            raise
    else:
        break
"""


@pytest.mark.parametrize("program", PROGRAMS)
def test_it_reaches_the_sockets_that_its_container_has_and_no_other(
    robot: SystemdRobot, program: str
) -> None:
    outcomes = {
        name: robot.as_user(f"robot-{program}", "/usr/bin/python3", "-c", CONNECT, path).returncode
        for name, path in SOCKETS.items()
    }
    assert outcomes == {name: 0 if name in CONNECTS[program] else 13 for name in SOCKETS}


def test_the_gateway_cannot_change_who_may_call(robot: SystemdRobot) -> None:
    inside = ["nsenter", "--mount", f"--target={robot.pid('gateway')}", "--"]
    directory = "/var/lib/robot-gateway"
    written = robot.run(*inside, "touch", f"{directory}/audit/x", check=False)
    assert written.returncode == 0, written.stderr
    for path in (
        f"{directory}/credentials/x",
        "/etc/robot-gateway/x",
        "/opt/robot-gateway/x",
    ):
        refused = robot.run(*inside, "touch", path, check=False)
        assert "Read-only file system" in refused.stderr, path


def test_the_doctor_finds_nothing_wrong(robot: SystemdRobot) -> None:
    """With the environment and the user of the unit, for root."""
    findings = json.loads(robot.run("robot-gateway", "doctor", "--json", check=False).stdout)
    listed = findings["findings"] if isinstance(findings, dict) else findings
    assert [each for each in listed if each["verdict"] == "wrong"] == []
    assert {"preview", "drive", "recording", "bridge"} <= {each["check"] for each in listed}


def test_a_frozen_program_is_started_again(robot: SystemdRobot) -> None:
    """All at once, because each takes as long as the watchdog waits."""
    frozen = {program: robot.pid(program) for program in PROGRAMS}
    restarts = {program: int(robot.property(program, "NRestarts")) for program in PROGRAMS}
    for pid in frozen.values():
        robot.run("kill", "-STOP", str(pid))
    for program in PROGRAMS:
        wait_until(
            lambda program=program: int(robot.property(program, "NRestarts")) == restarts[program] + 1,  # type: ignore[misc]
            f"robot-{program} is started again",
            FROZEN_BACK_WITHIN_S,
        )
        robot.wait_active(program)
        assert robot.pid(program) not in {0, frozen[program]}
        assert "Watchdog timeout" in robot.log(program)


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_killed_program_is_started_again(robot: SystemdRobot, program: str) -> None:
    killed = robot.pid(program)
    robot.run("kill", "-KILL", str(killed))
    wait_until(lambda: robot.pid(program) not in {0, killed}, f"robot-{program} is started again", 20)
    robot.wait_active(program)


def test_a_wrong_configuration_fails_once_with_the_line(robot: SystemdRobot) -> None:
    path = "/etc/robot-gateway/bridge.yaml"
    before = robot.output("cat", path)
    robot.write(path, "hubb: {}\n")
    try:
        failed = robot.run("systemctl", "restart", "robot-bridge", check=False)
        assert failed.returncode != 0
        assert "line 1" in robot.log("bridge")
        assert "hubb" in robot.log("bridge")
        assert robot.property("bridge", "ActiveState") == "failed"
        assert robot.property("bridge", "ExecMainStatus") == "2"
        # An upgrade is refused while it is so; what runs, runs on.
        refused = robot.run("/robot-gateway/scripts/install-robot", check=False)
        assert refused.returncode == 1
        assert f"{path} is wrong for this version" in refused.stderr
    finally:
        robot.write(path, before)
        robot.run("systemctl", "restart", "robot-bridge")


def test_done_again_it_changes_nothing(robot: SystemdRobot) -> None:
    before = {program: robot.pid(program) for program in PROGRAMS}
    done = robot.run("/robot-gateway/scripts/install-robot")
    assert done.stderr == "install-robot: up to date\n"
    assert {program: robot.pid(program) for program in PROGRAMS} == before
