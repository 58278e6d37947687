"""scripts/install-robot on a running robot, without a network: refusals, an upgrade and back, and its end."""

import os
from collections.abc import Iterator

import pytest

from tests.support.systemd_robot import SystemdRobot, build_image, running_robot

pytestmark = [pytest.mark.on_request, pytest.mark.docker, pytest.mark.timeout(900)]

SCRIPT = "/robot-gateway/scripts/install-robot"
PROGRAMS = ("gateway", "preview")
UPGRADED_WITHIN_S = 800
LEFT = ("/etc/robot-gateway/gateway.yaml", "/var/lib/robot-drive/a", "/var/lib/robot-gateway/audit/a")


@pytest.fixture(scope="module")
def robot() -> Iterator[SystemdRobot]:
    """As it has booted, with something in the directories that have to stay."""
    build_image()
    with running_robot(f"robot-install-{os.getpid()}") as robot:
        for program in PROGRAMS:
            robot.wait_active(program)
        robot.run("install", "-D", "-o", "robot-drive", "-m", "0600", "/dev/null", LEFT[1])
        robot.run("touch", LEFT[2])
        yield robot


def state(robot: SystemdRobot) -> str:
    """Of everything that it installs, and of what runs."""
    installed = (
        "/etc/robot-gateway /usr/local/lib/systemd /usr/local/bin /opt/robot-gateway /etc/systemd/system"
    )
    files = robot.output("sh", "-c", f"ls -lR --full-time {installed} | sha256sum; getent passwd | sha256sum")
    return files + " ".join(str(robot.pid(program)) for program in PROGRAMS)


def refusal(robot: SystemdRobot, *options: str) -> str:
    before = state(robot)
    done = robot.run(SCRIPT, *options, check=False)
    assert done.returncode in {1, 2}, done.stderr
    assert state(robot) == before
    line = done.stderr.strip()
    assert "\n" not in line, "one sentence, and what to type"
    return line


def test_without_gstreamer_it_refuses(robot: SystemdRobot) -> None:
    there = "/usr/lib/python3/dist-packages/gi"
    robot.run("mv", there, f"{there}.away")
    try:
        line = refusal(robot)
    finally:
        robot.run("mv", f"{there}.away", there)
    assert "GStreamer is missing here, or a part of it: its Python side. Type: sudo apt-get install" in line
    assert "gstreamer1.0-plugins-bad" in line


def test_a_missing_part_of_gstreamer_is_named(robot: SystemdRobot) -> None:
    (plugin,) = robot.output("sh", "-c", "ls /usr/lib/*/gstreamer-1.0/libgstsrt.so").split()
    robot.run("mv", plugin, "/root")
    try:
        assert "a part of it: srtsink. Type:" in refusal(robot)
    finally:
        robot.run("mv", "/root/libgstsrt.so", plugin)


def test_without_ros_it_refuses(robot: SystemdRobot) -> None:
    assert "there is no ROS 2: /opt/ros/jazzy/setup.bash does not exist" in refusal(
        robot, "--ros", "packages"
    )
    robot.run("mkdir", "-p", "/opt/ros/empty")
    robot.write("/opt/ros/empty/setup.bash", "export ROS_DISTRO=jazzy\n")
    line = refusal(robot, "--ros-setup", "/opt/ros/empty/setup.bash")
    assert "can't import rclpy and the common messages of /opt/ros/empty/setup.bash" in line


def test_a_workspace_in_a_home_directory_is_refused(robot: SystemdRobot) -> None:
    robot.write("/opt/ros/home.bash", "export PYTHONPATH=/home/robot/ws/install/lib\n")
    assert "leads to /home or /root, which the programs can't read" in refusal(
        robot, "--ros-setup", "/opt/ros/home.bash"
    )


def test_what_another_has_put_there_is_not_replaced(robot: SystemdRobot) -> None:
    robot.run("mv", "/usr/local/bin/robot-drive", "/root/robot-drive")
    robot.write("/usr/local/bin/robot-drive", "mine")
    try:
        assert "/usr/local/bin/robot-drive is something else" in refusal(robot)
        assert "/usr/local/bin/robot-drive is something else" in refusal(robot, "--uninstall")
    finally:
        robot.run("mv", "/root/robot-drive", "/usr/local/bin/robot-drive")


@pytest.mark.parametrize("options", [["--ros", "wheel"], ["--ros"], ["upgrade"]])
def test_a_word_it_does_not_know_changes_nothing(robot: SystemdRobot, options: list[str]) -> None:
    refusal(robot, *options)


def test_an_ordinary_user_learns_to_type_sudo(robot: SystemdRobot) -> None:
    done = robot.as_user("robot-preview", SCRIPT)
    assert (done.returncode, "Type: sudo scripts/install-robot" in done.stderr) == (1, True)


@pytest.mark.parametrize("mode", [[], ["--uninstall"]])
def test_a_dry_run_changes_nothing(robot: SystemdRobot, mode: list[str]) -> None:
    robot.run("sh", "-c", "echo '# more' >> /robot-gateway/common/version.py")
    before = state(robot)
    said = robot.run(SCRIPT, *mode, "--dry-run").stderr
    assert "install-robot: would " in said
    assert state(robot) == before


def version(robot: SystemdRobot) -> str:
    return str(robot.robotctl("status")["gateway_version"])


@pytest.mark.timeout(UPGRADED_WITHIN_S + 100)
def test_an_upgrade_and_back_keep_what_is_the_robots(robot: SystemdRobot) -> None:
    old, pids = version(robot), {program: robot.pid(program) for program in PROGRAMS}
    robot.write("/etc/robot-gateway/gateway.yaml", "name: mine\n")
    robot.run("systemctl", "disable", "--now", "robot-preview")
    robot.run("sed", "-i", 's/^version = .*/version = "99.0.0"/', "/robot-gateway/pyproject.toml")

    robot.run(SCRIPT, within_s=UPGRADED_WITHIN_S)
    assert version(robot) == "99.0.0"
    assert robot.pid("gateway") != pids["gateway"]
    assert robot.robotctl("status")["gateway_name"] == "mine"
    assert robot.property("preview", "ActiveState") == "inactive", "an upgrade starts nothing that was off"
    assert robot.property("preview", "UnitFileState") == "disabled"

    # As a version has it that is older than a program.
    before, unit = "/opt/robot-gateway/previous", "robot-tap.service"
    robot.run("rm", f"{before}/share/robot/systemd/{unit}", f"{before}/bin/robot-tap")
    robot.run("systemctl", "enable", unit)
    robot.run(SCRIPT, "--rollback")
    assert version(robot) == old
    assert robot.run("systemctl", "cat", unit, check=False).returncode != 0
    robot.run(SCRIPT, "--rollback")
    assert version(robot) == "99.0.0"
    assert robot.property("tap", "UnitFileState") == "enabled"
    for path in LEFT:
        robot.run("test", "-e", path)


def test_taken_away_it_leaves_configuration_state_and_users(robot: SystemdRobot) -> None:
    robot.run(SCRIPT, "--uninstall")
    assert robot.run("systemctl", "cat", "robot-gateway", check=False).returncode != 0
    for gone in ("/opt/robot-gateway", "/usr/local/bin/robot-gateway", "/run/robot-gateway"):
        assert robot.run("test", "-e", gone, check=False).returncode == 1, gone
    assert robot.run("pgrep", "-u", "robot-gateway", check=False).returncode == 1
    for path in LEFT:
        robot.run("test", "-e", path)
    robot.run("id", "robot-drive")
    # A second time there is nothing to do.
    robot.run(SCRIPT, "--uninstall")
    done = robot.run(SCRIPT, "--rollback", check=False)
    assert (done.returncode, done.stderr) == (1, "install-robot: there is no earlier version here\n")
