"""What docs/driving.md promises: how soon a subscriber behind the mux sees zero, by CLOCK_MONOTONIC."""

import os
import signal
import time
from collections.abc import Callable

import pytest

from tests.support.driving import Driving
from tests.support.promise import MS, keeps
from tests.support.undisturbed import undisturbed
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.timed]


def zero_after(robot: Driving, event: Callable[[], int], *, loses_worker: bool = False) -> float:
    """Drives, has something happen, and returns how long after it (`event` says when) zero arrived, in ms."""
    robot.drive()
    with robot.moving(loses_worker=loses_worker):
        since_ns = event()
        wait_until(lambda: not robot.witness.moves(), "zero")
        robot.settled()
    return robot.witness.zero_after_ms(since_ns)


def now_ns(_: object) -> int:
    return time.monotonic_ns()


def test_released(robot: Driving) -> None:
    def release() -> int:
        assert robot.peer
        began_ns = time.monotonic_ns()
        robot.peer.send(held=False)
        return began_ns

    keeps(60, "released, ms", lambda: zero_after(robot, release), per_stalled_s=MS)


def test_the_gateway_is_killed(robot: Driving) -> None:
    def kill() -> int:
        assert robot.peer
        began_ns = time.monotonic_ns()
        robot.peer.process.kill()
        return began_ns

    keeps(60, "gateway killed, ms", lambda: zero_after(robot, kill), per_stalled_s=MS)
    assert robot.state().stop.reason == "the driver was lost while driving: lost"


def test_the_gateway_is_frozen(robot: Driving) -> None:
    def freeze() -> int:
        assert robot.peer
        robot.peer.process.send_signal(signal.SIGSTOP)
        return robot.peer.instants.command_ns

    keeps(
        280, "gateway frozen, ms after the last command", lambda: zero_after(robot, freeze), per_stalled_s=MS
    )


def test_the_gateway_is_silent(robot: Driving) -> None:
    def fall_silent() -> int:
        assert robot.peer
        robot.peer.send(silent=True)
        robot.inhibited()
        return robot.peer.instants.command_ns

    keeps(
        280,
        "gateway silent, ms after the last command",
        lambda: zero_after(robot, fall_silent),
        per_stalled_s=MS,
    )


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "frozen"])
def test_the_worker_is_lost(robot: Driving, number: signal.Signals) -> None:
    def lose() -> int:
        pid = robot.worker.pid
        began_ns = time.monotonic_ns()
        os.kill(pid, number)
        return began_ns

    keeps(
        150, f"worker {number.name}, ms", lambda: zero_after(robot, lose, loses_worker=True), per_stalled_s=MS
    )
    assert wait_until(lambda: robot.state().stop.by, "a latched stop", 30) == "robot-drive"


def test_a_stop(robot: Driving) -> None:
    def stop() -> int:
        assert robot.peer
        began_ns = time.monotonic_ns()
        robot.peer.send(stop="ben")
        return began_ns

    keeps(
        50,
        "stop, ms",
        lambda: max(undisturbed(lambda: zero_after(robot, stop)) for _ in range(10)),
        per_stalled_s=MS,
    )


def test_the_picture_grows_old(robot: Driving) -> None:
    def freeze_picture() -> int:
        assert robot.peer
        robot.peer.send(picture_frozen=True)
        robot.inhibited()
        return robot.peer.instants.picture_ns

    keeps(
        650,
        "picture frozen, ms after its capture",
        lambda: zero_after(robot, freeze_picture),
        per_stalled_s=MS,
    )


def test_only_the_downlink_is_dead(robot: Driving) -> None:
    def freeze_echo() -> int:
        assert robot.peer
        robot.peer.send(echo_frozen=True)
        robot.inhibited()
        return robot.peer.instants.echo_ns

    keeps(
        450,
        "downlink dead, ms after the newest echo",
        lambda: zero_after(robot, freeze_echo),
        per_stalled_s=MS,
    )


def test_the_guard_is_killed(robot: Driving) -> None:
    def kill() -> int:
        assert robot.guard
        began_ns = time.monotonic_ns()
        robot.guard.kill()
        robot.guard.wait()
        return began_ns

    keeps(150, "guard killed, ms", lambda: zero_after(robot, kill, loses_worker=True), per_stalled_s=MS)
    wait_until(lambda: robot.observer.state() is None, "the worker has ended")
    robot.start()
    assert robot.state().stop.by == "robot-drive", "the next start finds a stop"


def test_the_guard_is_frozen(robot: Driving) -> None:
    def freeze() -> int:
        assert robot.guard
        began_ns = time.monotonic_ns()
        robot.guard.send_signal(signal.SIGSTOP)
        return began_ns

    def judged() -> float:
        try:
            return zero_after(robot, freeze, loses_worker=True)
        finally:
            assert robot.guard
            robot.guard.kill()
            robot.guard.wait()

    keeps(1500, "guard frozen, ms", judged, per_stalled_s=MS)


def test_both_are_killed_and_only_the_base_stops(robot: Driving) -> None:
    """Nothing of this program is left: the base's own timeout has to do it, as the doctor says."""

    def attempt() -> None:
        robot.drive()
        assert robot.guard
        with robot.moving():
            # In this order, so that neither has the time to notice the other's end.
            robot.guard.send_signal(signal.SIGSTOP)
            worker = robot.worker
            try:
                worker.suspend()
                robot.settled()
                assert robot.witness.moves()
            except BaseException:
                robot.guard.send_signal(signal.SIGCONT)
                raise
        worker.kill()
        robot.guard.kill()
        robot.guard.wait()

    undisturbed(attempt)
    robot.settled()
    assert robot.witness.moves(), "no zero: the double's revival after 71.6 minutes is possible"
