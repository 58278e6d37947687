"""The drive program in its container: hardened, on its own graph, and ended with zeros."""

import os
import signal
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from tests.e2e.containers.deployment import Deployment, demo_overlay, deployed, mounts, writable
from tests.support.driving import Observer, Peer
from tests.support.waiting import wait_until

# Timed: while a driver has the robot, 60 ms without a heartbeat stop it, and other tests take as much.
pytestmark = [pytest.mark.docker, pytest.mark.ros, pytest.mark.timed, pytest.mark.timeout(900)]

USER, GROUP = 10003, 10000


@pytest.fixture
def driven(tmp_path: Path, images: str) -> Iterator[Deployment]:  # noqa: ARG001  # for its effect
    with deployed(tmp_path, demo_overlay(), COMPOSE_PROFILES="drive", ROBOT_BASE="true") as deployment:
        deployment.wait_healthy("drive")
        robot = deployment.run(
            "exec", "robot", "simrobot", "control", "--control", "/tmp/robot.sock", "set", "commander=nobody"
        )
        assert robot.returncode == 0
        yield deployment


def processes(deployment: Deployment) -> dict[str, int]:
    """Those of the drive program by their part: guard of the container, guard, worker."""
    found = {}
    for pid in deployment.pids("drive"):
        words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
        if b"common.guard" in words and b"tini" not in words[0]:
            found["container"] = pid
        elif b"worker" in words:
            found["worker"] = pid
        elif b"serve" in words and b"tini" not in words[0]:
            found["guard"] = pid
    return found


def test_it_drives_is_hardened_and_survives_its_guard(driven: Deployment, tmp_path: Path) -> None:
    worker = processes(driven)["worker"]
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

    # The driver's end from outside, by the way into the container's files.
    path = Path(f"/proc/{worker}/root/run/robot-drive/drive.sock")
    with closing(Observer(path)) as observer, closing(Peer(path, tmp_path / "instants")) as peer:
        observer.phase_is("AVAILABLE")
        peer.send(lease="anna", held=False)
        wait_until(lambda: observer.now().newest_sequence > 0, "commands arrive")
        observer.phase_is("ARMED")
        peer.send(held=True)
        observer.phase_is("DRIVING")
        wait_until(lambda: observer.now().episode.distance_m > 0.05, "it goes through the mux")
        assert not observer.now().inhibits
        os.kill(processes(driven)["guard"], signal.SIGKILL)
        wait_until(lambda: driven.restarts("drive") > 0, "the engine starts it again")
    assert "the guard has gone" in driven.logs("drive"), "the worker had time for its zeros"
    driven.wait_healthy("drive")
