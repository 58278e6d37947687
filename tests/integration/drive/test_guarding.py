"""Guard and worker where one of them does not reach the base. Where it is the guard, the test plays it."""

import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from drive.processes.guard import HEARTBEATS, KILLS, STOPS
from drive.processes.reach import ReachSaid
from drive.processes.stop_file import Stops
from omniseer.drive.v1 import drive_pb2 as pb
from tests.support.driving import Driving, driving, witness
from tests.support.ros import simulated_robot
from tests.support.undisturbed import undisturbed
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.timed]

PROBLEM = "the guard of robot-drive does not reach the base yet, and could not stop it"
ENOUGH = 9
"""Subscriptions that the guard claims to have matched: no fewer than there are."""
AUTONOMY_MPS = 0.2
"""Faster than the driver."""


@contextmanager
def worker_alone(robot: Driving) -> Iterator[socket.socket]:
    """Runs the worker; yields the guard's end of the heartbeats, which are read."""
    config = robot.directory / "drive.yaml"
    values = {"socket": str(robot.socket), "state_dir": str(robot.directory)}
    config.write_text(json.dumps(values), encoding="utf-8")  # JSON is YAML
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours:
        with theirs:
            known = {HEARTBEATS: str(theirs.fileno()), STOPS: Stops().as_json(), KILLS: "0"}
            command = [sys.executable, "-m", "drive.cli", "worker", "--config", str(config)]
            robot.guard = subprocess.Popen(command, env=os.environ | known, pass_fds=[theirs.fileno()])

        def read() -> None:
            with suppress(ConnectionResetError):
                while ours.recv(65536):
                    pass

        reading = threading.Thread(target=read, name="heartbeats")
        reading.start()
        try:
            yield ours
        finally:
            robot.close()
            reading.join(10)


def test_nothing_moves_before_the_guards_own_zeros_would_arrive(
    tmp_path: Path,
    ros_domain: int,  # noqa: ARG001  # for its effect
) -> None:
    with simulated_robot(tmp_path, "--base", "commander=nobody") as base, witness() as seen:
        robot = Driving(base, seen, tmp_path)
        with worker_alone(robot) as worker:
            guard = ReachSaid(worker)
            peer = robot.ready()
            peer.send(lease="anna", held=False)
            wait_until(lambda: robot.state().newest_sequence > 10, "the worker has commands")
            wait_until(lambda: list(robot.state().problems) == [PROBLEM], "all but the guard is there")
            peer.send(held=True)
            since_ns = time.monotonic_ns()
            wait_until(lambda: robot.state().monotonic_ns > since_ns + 1_000_000_000, "a second")
            # A driver whom the machine holds up is late meanwhile, which is another reason.
            wait_until(lambda: list(robot.state().inhibits) == [pb.INHIBIT_BASE_ABSENT], "the one reason")
            assert not robot.witness.motion_since(since_ns)
            guard.say(ENOUGH)
            robot.drive()
            guard.say(0)
            robot.phase_is("INHIBITED")
            robot.settled()
            assert not robot.witness.moves()


def test_a_lost_worker_leaves_the_robot_to_no_other_source(tmp_path: Path, ros_domain: int) -> None:  # noqa: ARG001
    """The next worker's velocities and its lock reach nothing, as long as discovery takes."""

    def attempt() -> None:
        with TemporaryDirectory(dir=tmp_path) as name, driving(Path(name)) as robot:
            robot.drive()
            robot.robot.change(commander="autonomy", speed_mps=AUTONOMY_MPS, turn_rad_s=0)
            with robot.moving(loses_worker=True):
                lost_ns = time.monotonic_ns()
                loses_worker(robot, outputs=[{"topic": "/nowhere"}], lock_topic="/nowhere_lock")
                wait_until(
                    lambda: "nothing takes the velocities on /nowhere" in robot.state().problems,
                    "the next worker, which reaches nothing",
                    30,
                )
                stands_still(robot, lost_ns)
                assert "the zeros of the guard go on" in robot.log.read_text(encoding="utf-8")
                loses_worker(robot)
                wait_until(lambda: not robot.state().problems, "another one, which reaches the base", 30)
                stands_still(robot, lost_ns)

    undisturbed(attempt)


def loses_worker(robot: Driving, **settings: Any) -> None:
    """Kills the worker; the next one has these settings besides."""
    config = robot.directory / "drive.yaml"
    values = {"socket": str(robot.socket), "state_dir": str(robot.directory / "state")} | settings
    config.write_text(json.dumps(values), encoding="utf-8")
    worker = robot.worker
    worker.kill()
    wait_until(lambda: not worker.is_running(), "its end")


def stands_still(robot: Driving, since_ns: int) -> None:
    """Checks that autonomy has not moved the stopped robot, and does not within two seconds."""
    now_ns = time.monotonic_ns()
    wait_until(lambda: robot.state().monotonic_ns > now_ns + 2_000_000_000, "two seconds")
    assert robot.state().phase == pb.PHASE_STOPPED
    speeds = [speed for ns, speed in robot.witness.seen if ns >= since_ns]
    assert pytest.approx(AUTONOMY_MPS) not in speeds
