"""What robotctl drive makes of its keys, with a robot that the test plays."""

import asyncio
import io
import os
import signal
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import pytest
from rich.console import Console

from common.errors import UserError
from console.cli.drive import _Cockpit
from console.cli.drive_input import Controls, Input
from console.cli.drive_keys import Action, Hands, Liveness
from console.client import Unreachable
from console.client.results import DriveLimits, DrivePhase

EACH_LIMIT: dict[str, Any] = dict.fromkeys(DriveLimits.__slots__, 0.2)


def stopped(stop_id: int) -> Any:
    """A state of a robot that is stopped."""
    stop = SimpleNamespace(stop_id=stop_id, by="anna", reason="a child")
    still = {"vx_mps": 0.0, "vy_mps": 0.0, "wz_rad_s": 0.0}
    return SimpleNamespace(phase=DrivePhase.STOPPED, inhibits=(), stop=stop, **still)


class Robot:
    """Client and session, as far as the cockpit needs them."""

    limits = DriveLimits(**EACH_LIMIT)
    is_ready = False

    def __init__(self) -> None:
        self.state = stopped(5)
        self.resets: list[int] = []
        self.stops: list[str] = []

    def check(self) -> None:
        pass

    def reasons(self) -> str:
        stop = self.state.stop
        return f"stop {stop.stop_id}" if stop else ""

    def release(self) -> None:
        pass

    async def stop_robot(self, reason: str) -> Any:
        for _ in range(10):
            await asyncio.sleep(0)  # As a call that is on its way.
        self.stops.append(reason)
        return SimpleNamespace(message="")

    async def reset_stop(self, stop_id: int) -> Any:
        self.resets.append(stop_id)
        return SimpleNamespace(message="")


@pytest.mark.parametrize("as_json", [False, True])
async def test_r_resets_the_stop_that_is_shown_and_none_that_has_come_since(
    monkeypatch: pytest.MonkeyPatch, as_json: bool
) -> None:
    monkeypatch.setattr("console.cli.drive.json_form", lambda _: {})
    robot: Any = Robot()
    session: Any = SimpleNamespace(as_json=as_json, out=Console(file=io.StringIO()))
    cockpit = _Cockpit(session, robot, robot, (None, None), Controls(Input.KEYBOARD, None))
    hands = Hands(releases=False)
    cockpit._take("r", hands)
    cockpit._show(hands)
    robot.state = stopped(6)
    cockpit._take("r", hands)
    await asyncio.gather(*cockpit._calls)
    assert robot.resets == [5]
    cockpit._show(hands)
    cockpit._take("r", hands)
    await asyncio.gather(*cockpit._calls)
    assert robot.resets == [5, 6]


async def test_esc_ends_driving_also_while_an_answer_is_awaited() -> None:
    """Its character may be the first of that answer: what decides is that no other follows."""
    robot: Any = Robot()
    session: Any = SimpleNamespace(as_json=False, out=Console(file=io.StringIO()))
    cockpit = _Cockpit(session, robot, robot, (None, None), Controls(Input.KEYBOARD, None))
    hands = Hands(releases=False, liveness=Liveness(time.monotonic(), releases=False))
    assert hands.ask(time.monotonic())
    cockpit._take("\x1b", hands)
    assert not cockpit._ending
    await asyncio.wait_for(cockpit._drive(hands), 15)
    assert cockpit._ending


@pytest.mark.parametrize("late", [False, True])
async def test_a_stop_goes_out_also_where_driving_ends_at_once(
    monkeypatch: pytest.MonkeyPatch, late: bool
) -> None:
    monkeypatch.setattr("console.cli.drive._LAST_CALLS_S", 15.0)
    robot: Any = Robot()
    session: Any = SimpleNamespace(as_json=False, out=Console(file=io.StringIO()))
    cockpit = _Cockpit(session, robot, robot, (None, None), Controls(Input.KEYBOARD, None))
    if late:
        cockpit._take_meanwhile([Action.QUIT, Action.RESET, Action.STOP])
    else:
        cockpit._take(" x", Hands(releases=False))
    await cockpit._finish_calls()
    assert robot.stops == ["by the driver's keyboard"]
    assert not robot.resets
    assert cockpit._ending


@asynccontextmanager
async def _of_taps(*_: object) -> AsyncIterator[Hands]:
    yield Hands(releases=False)


def without_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes the cockpit run where no terminal is, as at one that answers nothing."""
    monkeypatch.setattr("console.cli.drive.Keyboard", MagicMock())
    monkeypatch.setattr("console.cli.drive.drive_terminal.reporting_keys", _of_taps)
    monkeypatch.setattr("console.cli.drive.drive_terminal.reading", MagicMock())


async def test_a_terminal_of_80_columns_has_room_for_the_warning_and_for_the_keys(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The defect: the warning was the beginning of the line, which cut the keys off."""
    without_a_terminal(monkeypatch)
    robot, screen = Robot(), io.StringIO()
    robot.state.phase, robot.state.stop, robot.is_ready = DrivePhase.ARMED, None, True
    session: Any = SimpleNamespace(as_json=False, out=Console(file=screen, width=80))
    port: Any = robot
    cockpit = _Cockpit(session, port, port, (None, None), Controls(Input.KEYBOARD, None))

    async def drive(hands: Hands) -> None:
        cockpit._take("", hands)
        cockpit._show(hands)

    monkeypatch.setattr(cockpit, "_drive", drive)
    await cockpit.run()
    assert "old presses count" in screen.getvalue()
    assert "hold w a s d to drive, space stops, x ends" in screen.getvalue()


async def run_until_a_stop(monkeypatch: pytest.MonkeyPatch, robot: Any) -> None:
    """Drives without a terminal; Space is the last key."""
    without_a_terminal(monkeypatch)
    session: Any = SimpleNamespace(as_json=True)
    cockpit = _Cockpit(session, robot, robot, (None, None), Controls(Input.KEYBOARD, None))

    async def drive(hands: Hands) -> None:
        cockpit._take(" x", hands)

    monkeypatch.setattr(cockpit, "_drive", drive)
    await cockpit.run()


@pytest.mark.parametrize("answers", [False, True])
async def test_a_stop_that_fails_after_the_end_of_driving_is_an_error(
    monkeypatch: pytest.MonkeyPatch, answers: bool
) -> None:
    """The defect: it failed without a word, and the driver believed that the robot had stopped."""
    monkeypatch.setattr("console.cli.drive._LAST_CALLS_S", 15.0 if answers else 0.05)
    robot: Any = Robot()

    async def stop_robot(_: str) -> Any:
        if answers:
            raise Unreachable("no route")
        await asyncio.Event().wait()

    robot.stop_robot = stop_robot
    why = "no route" if answers else "no answer within 0.05 s"
    with pytest.raises(UserError, match=f"the stop is not confirmed: {why}"):
        await run_until_a_stop(monkeypatch, robot)


async def test_a_second_signal_ends_no_stop_that_is_on_its_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """The defect: the handlers had gone by then. The signal here is one that does nothing without them."""
    monkeypatch.setattr("console.cli.drive._LAST_CALLS_S", 15.0)
    monkeypatch.setattr("console.cli.drive.ENDING", (signal.SIGURG,))
    ended = asyncio.Event()
    monkeypatch.setattr(_Cockpit, "_end", lambda _: ended.set())
    robot: Any = Robot()

    async def stop_robot(reason: str) -> Any:
        os.kill(os.getpid(), signal.SIGURG)
        await asyncio.wait_for(ended.wait(), 10)
        robot.stops.append(reason)
        return SimpleNamespace(message="")

    robot.stop_robot = stop_robot
    await run_until_a_stop(monkeypatch, robot)
    assert robot.stops == ["by the driver's keyboard"]
