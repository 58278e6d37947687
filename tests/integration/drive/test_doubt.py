"""Old commands, other sources, a missing base, and a log that nothing reads."""

import os
import signal
import subprocess
import sys
import time
from contextlib import nullcontext, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import psutil
import pytest

from bench.video.foreign import end
from common.ros_node import OwnNode, message_class, ros_node
from drive.config import DriveSettings
from omniseer.drive.v1 import drive_pb2 as pb
from tests.support.drive_peer import Instants
from tests.support.driving import Driving, driving
from tests.support.promise import MS, keeps
from tests.support.undisturbed import undisturbed
from tests.support.waiting import wait_until

# Timed: a machine that does other things makes the robot stop without need, which is right and fails a test.
pytestmark = [pytest.mark.ros, pytest.mark.timed]

END_S = 10
AT_THE_BASE_MS = 280
"""docs/driving.md: nothing is published by a command older than 250 ms, which
tests/unit/drive/processes/test_worker.py judges to the millisecond. The rest is the last velocity's way
through the middleware and the mux."""


def oldest_command_ms(robot: Driving, since_ns: int) -> float:
    """Returns how old the newest held command was, at most, when motion reached the base."""
    assert robot.peer
    held = Instants.held_ns(robot.peer.path)
    ages_ns = [
        moved_ns - max(sent_ns for sent_ns in held if sent_ns <= moved_ns)
        for moved_ns in robot.witness.motion_since(since_ns)
    ]
    return max(ages_ns, default=0) / 1e6


def test_blackouts_of_300_ms_do_not_move_the_robot_again_by_themselves(robot: Driving) -> None:
    def blackout() -> float:
        peer = robot.drive()
        with robot.moving():
            since_ns = time.monotonic_ns()
            peer.send(silent=True)
            robot.inhibited()
            time.sleep(0.05)
            peer.send(silent=False)  # The driver still holds.
            episode = robot.state().episode.episode_id
            time.sleep(0.3)
            assert robot.state().episode.episode_id == episode
            peer.send(held=False)
            robot.phase_is("ARMED", "INHIBITED")
            robot.settled()
        return oldest_command_ms(robot, since_ns)

    for _ in range(5):
        keeps(AT_THE_BASE_MS, "age of a command that moves, ms", blackout, per_stalled_s=MS)


@pytest.mark.parametrize("who", ["gateway", "drive"])
def test_frozen_and_thawed_again_and_again_nothing_old_moves(robot: Driving, who: str) -> None:
    """With the gateway, or with both processes of the drive program, whose socket fills meanwhile."""

    def freeze_and_thaw() -> float:
        peer = robot.drive()
        with robot.moving(loses_worker=who == "drive"):
            since_ns = time.monotonic_ns()
            assert robot.guard
            frozen = (
                [psutil.Process(peer.process.pid)]
                if who == "gateway"
                else [robot.worker, psutil.Process(robot.guard.pid)]
            )
            for process in frozen:
                process.suspend()
            time.sleep(0.3)
            episode = robot.observer.state() if who == "gateway" else None
            for process in reversed(frozen):
                process.resume()
            time.sleep(0.1)
            if episode:
                assert robot.state().episode.episode_id == episode.episode.episode_id
            with suppress(BrokenPipeError) if who == "drive" else nullcontext():
                peer.send(held=False)  # It ends with the worker.
            robot.settled()
        return oldest_command_ms(robot, since_ns)

    for _ in range(20):
        keeps(AT_THE_BASE_MS, "age of a command that moves, ms", freeze_and_thaw, per_stalled_s=MS)


def test_another_source_of_higher_priority_stops_us(robot: Driving) -> None:
    def attempt() -> None:
        robot.drive()
        try:
            with robot.moving():
                robot.robot.change(commander="unseen", speed_mps=0.2)
                robot.inhibited()
                wait_until(lambda: list(robot.state().inhibits) == [pb.INHIBIT_OUTRANKED], "it is outranked")
        finally:
            robot.robot.change(commander="nobody")
        robot.settled()

    undisturbed(attempt)


def test_without_a_base_nothing_is_driven(tmp_path: Path, ros_domain: int) -> None:  # noqa: ARG001
    def attempt() -> None:
        with TemporaryDirectory(dir=tmp_path) as name, driving(Path(name)) as robot:
            robot.drive()
            with robot.moving():
                robot.robot.process.terminate()
                state = robot.inhibited()
                assert set(state.inhibits) & {pb.INHIBIT_BASE_ABSENT, pb.INHIBIT_OUTRANKED}
                wait_until(lambda: pb.INHIBIT_BASE_ABSENT in robot.state().inhibits, "no base")
                missing = "nothing takes the velocities on /cmd_vel_keyboard"
                wait_until(lambda: missing in robot.state().problems, missing)

    undisturbed(attempt)


def test_a_recorder_of_our_own_is_no_base(tmp_path: Path, ros_domain: int) -> None:  # noqa: ARG001
    stamped = message_class("geometry_msgs/msg/TwistStamped")

    def attempt() -> None:
        with (
            TemporaryDirectory(dir=tmp_path) as name,
            driving(Path(name)) as robot,
            ros_node(OwnNode.RECORDER) as recorder,
        ):
            recorder.create_subscription(stamped, "/cmd_vel_keyboard", print, 10)
            robot.drive()
            with robot.moving():
                robot.robot.process.terminate()
                robot.robot.process.wait(10)
                wait_until(lambda: pb.INHIBIT_BASE_ABSENT in robot.state().inhibits, "the base is missed")
                # The witness, which counts as a base, may have been discovered later than the multiplexer.
                missing = "nothing takes the velocities on /cmd_vel_keyboard"
                wait_until(
                    lambda: list(robot.state().problems) == [missing], "only the multiplexer is missed"
                )

    undisturbed(attempt)


def test_autonomy_has_the_robot_before_and_after(robot: Driving) -> None:
    """Zeros mask a source of lower priority while a driver has the lease, and not afterwards."""

    def autonomy_drives() -> bool:
        return any(seen[1] == pytest.approx(0.2) for seen in robot.witness.seen[-1:])

    def attempt() -> None:
        peer = robot.ready()
        robot.settled()
        try:
            with robot.same_worker():
                robot.robot.change(commander="autonomy", speed_mps=0.2, turn_rad_s=0)
                wait_until(autonomy_drives, "autonomy drives")
                peer.send(lease="anna", held=False)
                wait_until(lambda: not robot.witness.moves(), "it is masked")
                peer.send(end="CLOSED")
                wait_until(autonomy_drives, "autonomy drives again")
                began_ns = time.monotonic_ns()
                peer.send(stop="ben")
                robot.phase_is("STOPPED")
                robot.settled()
                assert robot.witness.zero_after_ms(began_ns) < 1000
                robot.settled()
        finally:
            robot.robot.change(commander="nobody", speed_mps=0.0)

    undisturbed(attempt)


def test_a_reset_does_not_leave_the_robot_to_autonomy_that_goes_on(robot: Driving) -> None:
    def attempt() -> None:
        peer = robot.ready()
        try:
            with robot.same_worker():
                robot.robot.change(commander="autonomy", speed_mps=0.2, turn_rad_s=0)
                wait_until(robot.witness.moves, "autonomy drives")
                peer.send(stop="ben")
                robot.phase_is("STOPPED")
                robot.settled()
                state = robot.state()
                assert "motion on /cmd_vel_autonomy" in state.reset_obstacle
                began_ns = time.monotonic_ns()

                def nothing_follows_a_reset() -> None:
                    peer.send(reset=state.stop.stop_id)
                    since_ns = time.monotonic_ns()
                    wait_until(lambda: robot.state().monotonic_ns > since_ns + 1_000_000_000, "a second")
                    assert robot.state().phase == pb.PHASE_STOPPED
                    assert not robot.witness.motion_since(began_ns)

                nothing_follows_a_reset()
                peer.send(lease="anna", held=False)
                wait_until(lambda: not robot.state().reset_obstacle, "a driver keeps it away")
                # As when the driver's program has died: the lease is still there.
                peer.send(silent=True)
                wait_until(lambda: robot.state().reset_obstacle, "the driver is not heard any more")
                assert robot.state().session_id
                nothing_follows_a_reset()
                peer.send(silent=False)
                wait_until(lambda: not robot.state().reset_obstacle, "the driver is heard again")
                peer.send(reset=state.stop.stop_id)
                robot.phase_is("ARMED")
                assert not robot.witness.motion_since(began_ns)
                peer.send(stop="ben")
                robot.phase_is("STOPPED")
                peer.send(end="CLOSED")
                robot.robot.change(commander="nobody", speed_mps=0.0)
                wait_until(lambda: not robot.state().reset_obstacle, "autonomy is silent")
                peer.send(reset=robot.state().stop.stop_id)
                robot.phase_is("AVAILABLE")
                assert not robot.witness.motion_since(began_ns)
        finally:
            robot.robot.change(commander="nobody", speed_mps=0.0)

    undisturbed(attempt)


def test_a_reset_waits_until_a_source_that_moved_the_robot_can_be_heard(robot: Driving) -> None:
    """Of one that has just appeared the multiplexer may know before the drive program does."""
    mux_output = DriveSettings().mux_output
    assert mux_output
    message = message_class(mux_output.type)()
    message.twist.linear.x = 0.2

    def attempt() -> None:
        peer, moved_ns = robot.ready(), 0
        with robot.same_worker():
            with ros_node("unheard") as node:
                publisher = node.create_publisher(type(message), mux_output.topic, 1)

                def is_seen() -> bool:
                    nonlocal moved_ns
                    moved_ns = time.monotonic_ns()
                    publisher.publish(message)
                    return "moves the robot" in robot.state().reset_obstacle

                peer.send(stop="ben")
                robot.phase_is("STOPPED")
                wait_until(is_seen, "a source that no input shows moves the base")
            wait_until(lambda: "moves the robot" not in robot.state().reset_obstacle, "it is silent")
            assert "what else commands the robot" in robot.state().reset_obstacle
            wait_until(lambda: not robot.state().reset_obstacle, "it would have been heard")
            assert time.monotonic_ns() - moved_ns > 2_500_000_000
            peer.send(reset=robot.state().stop.stop_id)
            robot.phase_is("AVAILABLE")

    undisturbed(attempt)


def test_a_terminal_that_reads_nothing_keeps_no_zero_back(robot: Driving) -> None:
    """Standard error is a full pipe: a process that logs there itself would block before the zeros."""
    assert robot.guard
    robot.guard.terminate()
    robot.guard.wait(END_S)
    wait_until(lambda: robot.observer.state() is None, "the drive program has gone")
    reader, writer = os.pipe()
    try:
        try:
            fill(writer)
            config = robot.directory / "drive.yaml"
            robot.guard = subprocess.Popen(
                [sys.executable, "-m", "drive.cli", "serve", "--config", str(config)], stderr=writer
            )
        finally:
            os.close(writer)
        wait_until(robot.observer.state, "the drive program serves", 30)

        def freeze() -> float:
            robot.drive()
            with robot.moving(loses_worker=True):
                began_ns = time.monotonic_ns()
                os.kill(robot.worker.pid, signal.SIGSTOP)
                wait_until(lambda: not robot.witness.moves(), "zero")
                robot.settled()
            return robot.witness.zero_after_ms(began_ns)

        keeps(1000, "worker frozen, ms", freeze, per_stalled_s=MS)
    finally:
        end(robot.guard)  # The next test has one that logs to the robot's file.
        os.close(reader)


def fill(pipe: int) -> None:
    """Writes until there is no room any more; the pipe blocks afterwards."""
    os.set_blocking(pipe, False)
    try:
        while True:
            os.write(pipe, b"x" * 4096)
    except BlockingIOError:
        os.set_blocking(pipe, True)
