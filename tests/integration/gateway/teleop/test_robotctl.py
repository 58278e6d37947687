"""robotctl drive, stop and reset-stop, typed on a real terminal, at a robot of real parts."""

import asyncio
import functools
import json
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import ParamSpec

import pytest

from common.errors import ExitCode
from console.cli.drive_keys import KNOWN_FOR_S, TAP_S
from console.cli.loop_signals import ENDING
from console.gamepad.silence import HELD_FOR_S
from tests.support.driven_robot import DrivenRobot, drives_undisturbed, free, moving
from tests.support.kitty import KittyTerminal, kitty_with, robotctl_on_kitty
from tests.support.promise import keeps
from tests.support.robotctl import robotctl, robotctl_process
from tests.support.terminal import Terminal
from tests.support.undisturbed import DisturbedError, same_worker
from tests.support.waiting import wait_until

# Timed: on a machine that is busy with other tests, a hold lapses, and only a new one moves the robot again.
pytestmark = [pytest.mark.ros, pytest.mark.timed]
P = ParamSpec("P")

W_DOWN, W_REPEATED, W_UP = "\x1b[119;1:1u", "\x1b[119;1:2u", "\x1b[119;1:3u"
EVENT_TYPES = 2
LET_GO_S = 0.06
"""From the end of a hold at the terminal to a zero behind the multiplexer that no motion follows."""
TIMES = 3
QUIET_S = 0.7
"""Longer than any motion may last after that."""


@contextmanager
def robotctl_on_plain(*words: str) -> Iterator[KittyTerminal]:
    """The operator's program on a terminal that does not speak the protocol; ready to be driven with."""
    with robotctl_on_kitty(*words, speaks=False) as screen:
        screen.wait_for("hold w a s d")
        yield screen


def driven(test: Callable[P, None]) -> Callable[P, None]:
    """A test with a robot that is free; begun anew where a stall has cost the driver the robot."""

    @functools.wraps(test)
    def begun_anew(*args: P.args, **fixtures: P.kwargs) -> None:
        robot = fixtures["robot"]
        assert isinstance(robot, DrivenRobot)
        drives_undisturbed(robot, lambda: test(*args, **fixtures))

    return begun_anew


def at_rest(robot: DrivenRobot) -> None:
    wait_until(lambda: not robot.base.moves, "the base is at rest")


@driven
def test_a_tap_moves_the_robot_for_a_moment(robot: DrivenRobot) -> None:
    with robotctl_on_plain("drive", "--target", robot.target, "--speed", "0.1") as screen:
        before = len(screen.read())
        # The line is drawn several times a second: on a busy machine a tap may be over in between.
        wait_until(
            lambda: tap(screen, robot) and "driving" in screen.read()[before:], "it moves, and says so"
        )
        at_rest(robot)
        screen.press("x")
        assert screen.process.wait(20) == 0
        assert not screen.key_by_key(), "the terminal is as before"
        assert screen.read().rstrip().endswith("\x1b[?1004l")
    assert not robot.base.moves


def tap(screen: Terminal, robot: DrivenRobot) -> bool:
    screen.press("w")
    time.sleep(0.05)
    return robot.base.moves


def pressed_anew(screen: Terminal, robot: DrivenRobot) -> bool:
    if not robot.base.moves:
        screen.press(W_UP)
        screen.press(W_DOWN)
        time.sleep(0.3)
    return robot.base.moves


@driven
def test_a_key_moves_the_robot_while_it_is_down_where_the_terminal_reports_that(robot: DrivenRobot) -> None:
    with robotctl_on_kitty("drive", "--target", robot.target, "--json") as screen:
        screen.wait_for('"phase": "armed"')
        # The key goes up and down until the robot was ready for it; then it stays down.
        wait_until(lambda: pressed_anew(screen, robot), "the base moves")
        time.sleep(1.0)
        assert robot.base.moves, "without a repeat"
        screen.press(W_UP)
        at_rest(robot)
        screen.press("\x1b[120;1:1u")
        assert screen.process.wait(20) == 0
        assert "\x1b[<u" in screen.read()


@pytest.mark.alone
def test_a_key_released_in_a_terminal_stops_within_60_ms(robot: DrivenRobot) -> None:
    def measure() -> float:
        asyncio.run(free(robot))
        with same_worker(robot.drive), robotctl_on_kitty("drive", "--target", robot.target) as screen:
            screen.wait_for("hold w a s d")
            return max(released_after_s(screen, robot) for _ in range(TIMES))

    keeps(LET_GO_S, "s of motion after a key was released in a terminal", measure)


def released_after_s(screen: Terminal, robot: DrivenRobot) -> float:
    """How long the base moves after the release of a key that was down."""
    wait_until(lambda: pressed_anew(screen, robot), "the base moves")
    with moving(robot.base, robot.drive):
        released_s = time.monotonic()
        screen.press(W_UP)
        time.sleep(QUIET_S)
    return robot.base.stopped_after_s(released_s)


@pytest.mark.alone
def test_a_tap_stops_within_60_ms_after_its_short_hold(robot: DrivenRobot) -> None:
    def measure() -> float:
        asyncio.run(free(robot))
        with same_worker(robot.drive), robotctl_on_plain("drive", "--target", robot.target) as screen:
            wait_until(lambda: tap(screen, robot), "the base moves")
            return max(tapped_after_s(screen, robot) for _ in range(TIMES))

    keeps(TAP_S + LET_GO_S, "s from a press to the end of its motion", measure)


def tapped_after_s(screen: Terminal, robot: DrivenRobot) -> float:
    """How long after the press of a key, of which no release is reported, the base moves."""
    at_rest(robot)
    time.sleep(QUIET_S)  # It has come to its end: only then does the next press begin a motion of its own.
    before = len(robot.base.heard)
    pressed_s = time.monotonic()
    screen.press("w")
    time.sleep(TAP_S + QUIET_S)
    if not any(each.moves for each in robot.base.heard[before:]):
        raise DisturbedError("the press had ended before the robot could follow it")
    return robot.base.stopped_after_s(pressed_s)


@driven
def test_a_terminal_that_freezes_releases_its_keys(robot: DrivenRobot) -> None:
    """As one does at whose end of an SSH connection the cable is cut: no release can come."""
    with robotctl_on_kitty("drive", "--target", robot.target) as screen:
        screen.wait_for("hold w a s d")
        wait_until(lambda: pressed_anew(screen, robot), "the base moves")
        screen.freeze()
        frozen_s = time.monotonic()
        wait_until(lambda: not robot.base.moves, "the base is at rest", KNOWN_FOR_S + 1.0)
        assert time.monotonic() - frozen_s < KNOWN_FOR_S + 0.5
        before = len(robot.base.heard)
        screen.press(W_REPEATED)
        screen.thaw()
        screen.press(W_REPEATED)
        time.sleep(0.5)
        assert not any(each.moves for each in robot.base.heard[before:]), "the key is still down"
        wait_until(lambda: pressed_anew(screen, robot), "a new press moves it")
        screen.press("\x1b[99;5:1u")
        assert screen.process.wait(20) == 0


@driven
def test_presses_that_are_held_up_on_their_way_move_nothing(robot: DrivenRobot) -> None:
    """As after a gap of an SSH connection: what was pressed in it comes at once, however old it is."""
    with robotctl_on_plain("drive", "--target", robot.target, "--speed", "0.1") as screen:
        wait_until(lambda: tap(screen, robot), "the base moves")
        at_rest(robot)
        screen.freeze()
        screen.wait_for("the terminal does not answer", after=len(screen.read()))
        before = len(robot.base.heard)
        screen.press("www")
        time.sleep(TAP_S)
        screen.thaw()
        time.sleep(TAP_S)
        assert not any(each.moves for each in robot.base.heard[before:])
        wait_until(lambda: tap(screen, robot), "a press of now moves it")
        screen.press("x")
        assert screen.process.wait(20) == 0


@pytest.mark.parametrize("knows", [0, 1, 13], ids=["nothing", "escape codes", "all but releases"])
@driven
def test_a_terminal_that_speaks_the_protocol_without_releases_is_one_of_taps(
    robot: DrivenRobot, knows: int
) -> None:
    assert not knows & EVENT_TYPES
    with robotctl_on_kitty("drive", "--target", robot.target, knows=knows) as screen:
        screen.wait_for("hold w a s d")
        wait_until(lambda: not screen.kitty.pushed, "it is as before")
        wait_until(lambda: tap(screen, robot), "the base moves")
        wait_until(lambda: not robot.base.moves, "the base is at rest", 2)
        screen.press("x")
        assert screen.process.wait(20) == 0


@pytest.mark.parametrize("number", ENDING, ids=lambda each: each.name)
@driven
def test_a_signal_leaves_the_terminal_as_it_was(robot: DrivenRobot, number: signal.Signals) -> None:
    with robotctl_on_kitty("drive", "--target", robot.target) as screen:
        screen.wait_for("hold w a s d")
        assert screen.kitty.flags & EVENT_TYPES
        wait_until(lambda: pressed_anew(screen, robot), "the base moves")
        screen.process.send_signal(number)
        assert screen.process.wait(20) == 0
        at_rest(robot)
        wait_until(lambda: not screen.kitty.pushed, "the protocol is as before")
        assert "\x1b[?1004l" in screen.read()
        assert not screen.key_by_key()


@driven
def test_space_stops_and_the_stop_is_reset_by_its_number(robot: DrivenRobot) -> None:
    with robotctl_on_plain("drive", "--target", robot.target) as screen:
        screen.press(" ")
        screen.wait_for("stopped")
        screen.press("r")
        screen.wait_for("armed", after=screen.drawn.index("stopped"))
        stopped = robotctl("stop", "--reason", "lunch", "--target", robot.target, "--json")
        assert stopped.returncode == 0, stopped.stderr
        document = json.loads(stopped.stdout)
        assert (document["ok"], document["stop"]["reason"]) == (True, "lunch")
        screen.wait_for("lunch")
        stop_id = str(document["stop"]["stop_id"])
        wrong = robotctl("reset-stop", str(document["stop"]["stop_id"] + 7), "--target", robot.target)
        assert wrong.returncode == 1
        assert stop_id in wrong.stderr
        reset = robotctl_process("reset-stop", stop_id, "--target", robot.target)
        assert reset.returncode == 0, reset.stderr
        assert "is reset" in reset.stdout
        screen.press("\x03")
        assert screen.process.wait(20) == 0


@driven
def test_driving_is_disabled_without_a_terminal_and_enabled_again(robot: DrivenRobot) -> None:
    try:
        with robotctl_on_plain("drive", "--target", robot.target) as screen:
            disabled = robotctl("drive", "--disable", "--target", robot.target, "--json")
            assert disabled.returncode == 0, disabled.stderr
            document = json.loads(disabled.stdout)
            assert (document["ok"], document["teleop"]["enabled"]) == (True, False)
            assert screen.process.wait(20) == 1, "its session has ended"
        assert not robot.teleop.enabled
        again = robotctl_process("drive", "--disable", "--target", robot.target)
        assert (again.returncode, again.stdout) == (0, "driving is disabled\n")
    finally:
        with robotctl_on_plain("drive", "--enable", "--target", robot.target) as screen:
            screen.press("x")
            assert screen.process.wait(20) == 0
    assert robot.teleop.enabled


@pytest.mark.parametrize(
    "more", [("--enable",), ("--take-over",), ("--speed", "0.1"), ("--turn", "0.1"), ("--input", "keyboard")]
)
def test_what_drives_is_refused_beside_disable(robot: DrivenRobot, more: tuple[str, ...]) -> None:
    refused = robotctl("drive", "--disable", *more, "--target", robot.target)
    assert refused.returncode == ExitCode.USAGE
    assert "--disable drives nothing" in refused.stderr
    assert robot.teleop.enabled


@contextmanager
def with_a_gamepad(robot: DrivenRobot, columns: int = 160) -> Iterator[Terminal]:
    """Robotctl drive with a gamepad in the test's hands, at a terminal that does not report releases."""
    words = ["drive", "--input", "gamepad", "--target", robot.target]
    program = [sys.executable, "-m", "tests.support.padded_robotctl", *words]
    with kitty_with(program, speaks=False, columns=columns) as screen:
        screen.wait_for("hold a shoulder button of")
        yield screen


@driven
def test_a_gamepad_drives_while_its_shoulder_is_held_until_it_is_unplugged(robot: DrivenRobot) -> None:
    with with_a_gamepad(robot) as screen:
        screen.press("w")
        screen.process.send_signal(signal.SIGUSR1)
        wait_until(lambda: robot.base.moves, "the base moves")
        screen.process.send_signal(signal.SIGUSR1)
        time.sleep(1.0)
        assert robot.base.moves, "as long as it is held"
        screen.process.send_signal(signal.SIGUSR2)
        at_rest(robot)
        screen.wait_for("plug a gamepad in")
        screen.press("x")
        assert screen.process.wait(20) == 0


@driven
def test_a_gamepad_without_a_cable_that_reports_nothing_new_is_released(robot: DrivenRobot) -> None:
    """As one out of range: the computer keeps its last values for seconds."""
    with with_a_gamepad(robot, columns=260) as screen:
        screen.process.send_signal(signal.SIGUSR1)
        held_s = time.monotonic()
        wait_until(lambda: robot.base.moves, "the base moves")
        wait_until(lambda: not robot.base.moves, "the base is at rest", HELD_FOR_S + 1.0)
        assert time.monotonic() - held_s < HELD_FOR_S + 0.5
        screen.wait_for("nothing new")
        before = len(robot.base.heard)
        screen.process.send_signal(signal.SIGUSR1)
        time.sleep(0.5)
        assert not any(each.moves for each in robot.base.heard[before:]), "it is back, and still held"
        screen.press("x")
        assert screen.process.wait(20) == 0


@driven
def test_a_terminal_that_loses_the_focus_releases_the_gamepad_as_well(robot: DrivenRobot) -> None:
    with with_a_gamepad(robot) as screen:
        screen.process.send_signal(signal.SIGUSR1)
        wait_until(lambda: robot.base.moves, "the base moves")
        screen.press("\x1b[O")
        wait_until(lambda: not robot.base.moves, "the base is at rest", 2)
        before = len(robot.base.heard)
        screen.press("\x1b[I")
        time.sleep(0.5)
        assert not any(each.moves for each in robot.base.heard[before:]), "it counts when it is held anew"
        screen.press("x")
        assert screen.process.wait(20) == 0


@driven
def test_without_a_terminal_it_says_so(robot: DrivenRobot) -> None:
    refused = robotctl_process("drive", "--target", robot.target)
    assert refused.returncode == 1
    assert "terminal" in refused.stderr
