"""Driving through the containers: client library, gateway, drive program, base; and what ends it."""

import json
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from console.client.blocking import GatewayClient
from console.client.errors import GatewayError
from console.client.results import DrivePhase
from tests.e2e.containers.deployment import (
    Deployment,
    answers_are_due,
    demo_overlay,
    deployed,
    mounts,
    writable,
)
from tests.support.driver_program import SPEED_MPS, driver
from tests.support.driving import Observer
from tests.support.robotctl import robotctl_process
from tests.support.undisturbed import SILENT, WORKER_LOST, DisturbedError, no_stall, undisturbed
from tests.support.waiting import wait_until

# Timed: while a driver has the robot, 60 ms without a heartbeat stop it, and other tests take as much.
pytestmark = [pytest.mark.docker, pytest.mark.ros, pytest.mark.timed, pytest.mark.timeout(900)]

USER, GROUP = 10003, 10000
UP_WITHIN_S = 60.0
RESTART_TAKES_S = 0.5
"""At least, until the next start sends zeros because of the stop that it finds. The promise itself, 150 ms,
is measured without containers (tests/integration/drive/test_stopping.py)."""
CONTROL = ("simrobot", "control", "--control", "/tmp/robot.sock")


@pytest.fixture(scope="module")
def deployment(
    tmp_path_factory: pytest.TempPathFactory,
    images: str,  # noqa: ARG001  # for its effect
) -> Iterator[Deployment]:
    """A robot with a base that nothing else drives."""
    directory = tmp_path_factory.mktemp("drive")
    with deployed(directory, demo_overlay(), COMPOSE_PROFILES="drive", ROBOT_BASE="true") as deployment:
        nothing_else = ("exec", "robot", *CONTROL, "set", "commander=nobody")
        wait_until(
            lambda: deployment.run(*nothing_else, check=False).returncode == 0, "the robot is up", UP_WITHIN_S
        )
        yield deployment


@pytest.fixture
def driven(deployment: Deployment) -> Deployment:
    """The same, and the robot is not stopped. The engine's own health checks come too rarely to wait for."""
    free(deployment)
    return deployment


def free(deployment: Deployment) -> None:
    """Waits until the robot can be driven, and resets what stops it."""
    with deployment.client() as robot:
        wait_until(lambda: is_available(robot), "the robot can be driven", UP_WITHIN_S)


def drives_undisturbed(deployment: Deployment, attempt: Callable[[], None]) -> None:
    """Makes attempts with a robot that can be driven, until no stall of the machine explains what fails."""

    def begun() -> None:
        free(deployment)
        before = silences(deployment)
        try:
            with no_stall(), answers_are_due():
                attempt()
        except AssertionError as error:
            if silences(deployment) > before:
                raise DisturbedError(WORKER_LOST) from error
            raise

    undisturbed(begun)


def silences(deployment: Deployment) -> int:
    """How often the guard has killed a worker for its silence."""
    return deployment.logs("drive").count(SILENT)


def is_available(robot: GatewayClient) -> bool:
    """Whether the robot can be driven; resets what is stopped."""
    teleop = teleop_of(robot)
    if teleop and teleop.stop:
        try:
            robot.reset_stop(teleop.stop.stop_id)
        except GatewayError:
            return False
    return bool(teleop and teleop.phase is DrivePhase.AVAILABLE)


def teleop_of(robot: GatewayClient) -> Any:
    """Driving, as the status has it; None while the gateway does not answer."""
    try:
        return robot.status().teleop
    except GatewayError:
        return None


def stop_of(robot: GatewayClient) -> Any:
    """The stop of a robot that is connected and stopped, else None."""
    teleop = teleop_of(robot)
    return teleop.stop if teleop and teleop.phase is DrivePhase.STOPPED else None


def speed_mps(robot: GatewayClient) -> float:
    """Of the base, by its odometry."""
    return robot.status().odometry.linear_speed_mps or 0.0


def heard_by_the_base(deployment: Deployment) -> dict[str, float]:
    """When the last motion came to the base, and the first zero after it, on its monotonic clock."""
    heard: dict[str, float] = json.loads(deployment.run("exec", "robot", *CONTROL, "base").stdout)
    return heard


def processes(deployment: Deployment) -> dict[str, int]:
    """Those of the drive program by their part: guard of the container, guard, worker."""
    found = {}
    for pid in deployment.pids("drive"):
        try:
            words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
        except (FileNotFoundError, ProcessLookupError):  # It has just ended.
            continue
        if b"common.guard" in words and b"tini" not in words[0]:
            found["container"] = pid
        elif b"worker" in words:
            found["worker"] = pid
        elif b"serve" in words and b"tini" not in words[0]:
            found["guard"] = pid
    return found


def worker_of(deployment: Deployment) -> int:
    """The worker's process; one that was silent for too long is being replaced."""
    return wait_until(lambda: processes(deployment).get("worker"), "a worker", UP_WITHIN_S)


def observer_of(driven: Deployment) -> Observer:
    """Reads the drive program's own socket, by the way into the container's files."""
    return Observer(Path(f"/proc/{worker_of(driven)}/root/run/robot-drive/drive.sock"))


def test_it_drives_and_anyone_stops_it(driven: Deployment) -> None:
    def attempt() -> None:
        with driver(driven.target), driven.client() as robot:
            wait_until(lambda: speed_mps(robot) > SPEED_MPS / 2, "the base moves, by its odometry")
            assert robot.status().teleop.phase is DrivePhase.DRIVING
            stopped = robotctl_process("--target", driven.target, "stop", "--reason", "a test")
            assert stopped.returncode == 0, stopped.stderr
            wait_until(lambda: speed_mps(robot) == 0.0, "the base stands still")
            teleop = robot.status().teleop
            assert teleop.phase is DrivePhase.STOPPED
            assert teleop.stop
            assert teleop.stop.reason == "a test"

    drives_undisturbed(driven, attempt)


def test_a_gateway_that_is_killed_leaves_a_stopped_robot(driven: Deployment) -> None:
    def attempt() -> None:
        with closing(observer_of(driven)) as observer:
            with driver(driven.target):
                driven.signal_all("gateway", signal.SIGKILL)
                stopped = observer.phase_is("STOPPED")
            assert (stopped.vx_mps, stopped.vy_mps, stopped.wz_rad_s) == (0, 0, 0)
            assert "the driver was lost while driving" in stopped.stop.reason
        with driven.client() as robot:
            found = wait_until(
                lambda: (it := teleop_of(robot)) and it.stop, "the next gateway reports it", UP_WITHIN_S
            )
            assert found.stop_id == stopped.stop.stop_id

    drives_undisturbed(driven, attempt)


def test_a_stop_outlives_a_restart_of_the_drive_container(driven: Deployment) -> None:
    def attempt() -> None:
        with driven.client() as robot:
            before = robot.stop_robot("before the restart").stop
            driven.run("restart", "drive")
            after = wait_until(lambda: stop_of(robot), "connected again, and stopped", UP_WITHIN_S)
            assert (after.stop_id, after.by, after.reason) == (before.stop_id, before.by, before.reason)
            wait_until(lambda: is_available(robot), "reset", UP_WITHIN_S)
            with driver(driven.target):
                wait_until(lambda: speed_mps(robot) > SPEED_MPS / 2, "it drives again", UP_WITHIN_S)

    drives_undisturbed(driven, attempt)


def test_it_is_hardened_and_survives_its_guard(driven: Deployment) -> None:
    worker = worker_of(driven)
    status = dict(
        line.split(":\t", 1)
        for line in Path(f"/proc/{worker}/status").read_text(encoding="ascii").splitlines()
        if ":\t" in line
    )
    assert set(status["Uid"].split()) == {str(USER)}
    assert set(status["Gid"].split()) == {str(GROUP)}
    assert int(status["CapBnd"], 16) == 0
    assert status["NoNewPrivs"] == "1"
    assert writable(worker) == {"/tmp", "/run/robot-drive", "/var/lib/robot-drive", "/dev/shm"}
    assert "ro" in mounts(worker)["/"]

    def attempt() -> None:
        restarts = driven.restarts("drive")
        with driver(driven.target):
            os.kill(processes(driven)["guard"], signal.SIGKILL)
            wait_until(lambda: driven.restarts("drive") > restarts, "the engine starts it again", UP_WITHIN_S)
        heard = heard_by_the_base(driven)
        assert heard["zero_s"] - heard["moved_s"] < RESTART_TAKES_S, "the worker had time for its zeros"
        wait_until(lambda: driven.passes_its_check("drive"), "it is healthy again", UP_WITHIN_S)
        with driven.client() as robot:
            stop = wait_until(lambda: stop_of(robot), "the next start finds a stop", UP_WITHIN_S)
            assert stop.by == "robot-drive"

    drives_undisturbed(driven, attempt)


def test_its_limits_are_in_force_and_it_goes_before_no_other_program(deployment: Deployment) -> None:
    """The other programs yield to the mission (test_hardening.py)."""
    limits = deployment.inspect("drive")["HostConfig"]
    assert (limits["Memory"], limits["PidsLimit"]) == (256 << 20, 128)
    assert limits["NanoCpus"] == min(1.5, os.cpu_count() or 1) * 1e9
    assert limits["CpuShares"] == 4096
    worker = worker_of(deployment)
    assert int(Path(f"/proc/{worker}/oom_score_adj").read_text(encoding="ascii")) <= 0
