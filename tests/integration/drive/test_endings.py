"""Every way that driving ends: the last message is zero, and the motion is recorded."""

import os
import signal
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pytest

from tests.support.driving import Driving, driving
from tests.support.undisturbed import undisturbed
from tests.support.waiting import wait_until

# Timed: a machine that does other things makes the robot stop without need, which is right and fails a test.
pytestmark = [pytest.mark.ros, pytest.mark.timed]

DEFECTS = """
import gc, signal, sys

def fail(*_):
    raise RuntimeError("a defect")

def shut_down(*_):
    from rclpy.context import Context
    gc.unfreeze()
    for each in gc.get_objects():
        if isinstance(each, Context):
            each.shutdown()

if "drive.cli" in sys.orig_argv:
    signal.signal(signal.SIGUSR1, fail)
    signal.signal(signal.SIGUSR2, shut_down)
"""
"""What goes wrong in guard and worker: an error wherever the program is, and the end of its part of ROS."""
IN_ORDER = frozenset({signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT})
"""Signals that end the guard, and so the worker, in order."""
TYPED = (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT)
"""Of these, what a terminal sends: to both processes, of which the guard alone takes them."""
FAIL, SHUT_DOWN = signal.SIGUSR1, signal.SIGUSR2


@contextmanager
def disposed(numbers: Iterable[signal.Signals], how: signal.Handlers) -> Iterator[None]:
    """Has programs that are started in the block ignore these signals, or not."""
    before = {number: signal.signal(number, how) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@pytest.fixture(scope="module", autouse=True)
def _taken() -> Iterator[None]:
    """Programs take what those of a test run in the background of a script would ignore."""
    ignored = [number for number in IN_ORDER if signal.getsignal(number) is signal.SIG_IGN]
    with disposed(ignored, signal.SIG_DFL):
        yield


@pytest.fixture(scope="module")
def robot(
    _taken: None,
    module_ros_domain: int,  # noqa: ARG001  # for its effect
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[Driving]:
    directory = tmp_path_factory.mktemp("drive")
    (directory / "sitecustomize.py").write_text(DEFECTS, encoding="utf-8")
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("PYTHONPATH", str(directory), prepend=os.pathsep)
        with driving(directory) as made:
            yield made


def _send(**line: Any) -> Callable[[Driving], None]:
    def send(robot: Driving) -> None:
        assert robot.peer
        robot.peer.send(**line)

    return send


def _signal(who: str, number: signal.Signals) -> Callable[[Driving], None]:
    def send(robot: Driving) -> None:
        assert robot.guard
        assert robot.peer
        guard, worker, gateway = robot.guard.pid, robot.worker.pid, robot.peer.process.pid
        for pid in {"gateway": [gateway], "worker": [worker], "guard": [guard], "both": [guard, worker]}[who]:
            with suppress(ProcessLookupError):  # The worker may have been ended by the guard.
                os.kill(pid, number)
        if who in {"guard", "both"}:
            code = robot.guard.wait(10)
            assert code == 0 or number not in IN_ORDER

    return send


ENDINGS = {
    "released": _send(held=False),
    "stopped": _send(stop="ben"),
    "disabled": _send(enabled=False),
    "closed": _send(end="CLOSED"),
    "access ended": _send(end="ACCESS_ENDED"),
    "taken over": _send(lease="ben"),
    "gateway killed": _signal("gateway", signal.SIGKILL),
    "gateway frozen": _signal("gateway", signal.SIGSTOP),
    "worker killed": _signal("worker", signal.SIGKILL),
    "worker frozen": _signal("worker", signal.SIGSTOP),
    "worker terminated": _signal("worker", signal.SIGTERM),
    "ended": _signal("guard", signal.SIGTERM),
    "guard killed": _signal("guard", signal.SIGKILL),
    "worker fails": _signal("worker", FAIL),
    "guard fails": _signal("guard", FAIL),
    "worker without ROS": _signal("worker", SHUT_DOWN),
    "guard without ROS": _signal("guard", SHUT_DOWN),
    "both ended": _signal("both", signal.SIGTERM),
    "interrupted by its terminal": _signal("both", signal.SIGINT),
    "its terminal closed": _signal("both", signal.SIGHUP),
    "quit by its terminal": _signal("both", signal.SIGQUIT),
}
LEAVING = frozenset(
    {
        "released",
        "stopped",
        "disabled",
        "closed",
        "access ended",
        "taken over",
        "gateway killed",
        "gateway frozen",
    }
)
"""Endings that leave the worker alive."""
LOSSES = {
    "gateway killed": "stopped by anna: the driver was lost",
    "worker killed": "robot-drive lost its worker",
    "worker frozen": "robot-drive lost its worker",
    "ended": "robot-drive was ended",
    "guard killed": "robot-drive was ended",
}
"""Endings of a motion that no gateway has recorded, and why it has ended."""


@pytest.mark.parametrize("ending", ENDINGS)
def test_whatever_ends_it_the_last_message_is_zero(robot: Driving, ending: str) -> None:
    """And a motion that no gateway has recorded outlives the program."""

    def attempt() -> int:
        robot.drive()
        try:
            with robot.moving(loses_worker=ending not in LEAVING):
                started_ns = robot.state().episode.started_ns
                ENDINGS[ending](robot)
                if ending in LOSSES:
                    robot.settled()
        finally:
            # Of a stall this holds as well: nothing here is excused by one.
            wait_until(lambda: not robot.witness.moves(), "the last message is zero")
            robot.settled()
            assert not robot.witness.moves()
        return started_ns

    started_ns = undisturbed(attempt)
    if ending in LOSSES:
        outlives_the_program(robot, started_ns, LOSSES[ending])


def outlives_the_program(robot: Driving, started_ns: int, why: str) -> None:
    """Asserts that the motion which began then is there to be recorded, by another process if need be."""
    assert robot.guard
    if robot.guard.poll() is not None:
        wait_until(lambda: robot.observer.state() is None, "the drive program has gone")
        robot.start()
    episode = wait_until(
        lambda: episode if (episode := robot.state().episode).ended_ns else None, "the end of the motion", 30
    )
    assert (episode.holder, episode.started_ns, episode.recorded) == ("anna", started_ns, False)
    assert episode.ended_by.startswith(why)
    assert 0 < episode.distance_m < 1
    assert 0 < (episode.ended_ns - episode.started_ns) / 1e9 < 60


def test_no_terminal_freezes_it(robot: Driving) -> None:
    """Ctrl-Z goes to both processes at once, and so does SIGTTOU: no zero would go out."""

    def attempt() -> None:
        peer = robot.drive()
        assert robot.guard
        with robot.moving():
            for number in (signal.SIGTSTP, signal.SIGTTOU):
                for pid in (robot.guard.pid, robot.worker.pid):
                    os.kill(pid, number)
            runs_on(robot)
            peer.send(held=False)
            robot.settled()
        assert not robot.witness.moves()

    undisturbed(attempt)


def test_the_worker_leaves_to_the_guard_what_a_terminal_sends(robot: Driving) -> None:
    def attempt() -> None:
        peer = robot.drive()
        with robot.moving():
            for number in TYPED:
                os.kill(robot.worker.pid, number)
            runs_on(robot)
            peer.send(held=False)
            robot.settled()
        assert not robot.witness.moves()

    undisturbed(attempt)


def test_what_it_was_started_to_ignore_does_not_end_it(robot: Driving) -> None:
    """SIGHUP by nohup; the others by a script that starts it in the background."""

    def attempt() -> None:
        robot.ready()
        ended(robot)
        with disposed(TYPED, signal.SIG_IGN):
            robot.start()
        assert robot.guard
        with robot.same_worker():
            for pid in (robot.guard.pid, robot.worker.pid):
                for number in TYPED:
                    with suppress(ProcessLookupError):  # After a stall the guard has ended the worker.
                        os.kill(pid, number)
            runs_on(robot)
        ended(robot)

    undisturbed(attempt)


def runs_on(robot: Driving) -> None:
    """Waits for a state of a second later."""
    since_ns = time.monotonic_ns()
    wait_until(lambda: robot.state().monotonic_ns > since_ns + 1_000_000_000, "a second")


def ended(robot: Driving) -> None:
    """Ends the drive program."""
    assert robot.guard
    robot.guard.terminate()
    robot.guard.wait(10)
    wait_until(lambda: robot.observer.state() is None, "the drive program has gone")
