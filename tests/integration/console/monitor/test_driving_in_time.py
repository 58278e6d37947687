"""How fast a driver who lets go, or is taken away, stops the robot: seen behind the multiplexer."""

import asyncio
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import pytest
from PySide6.QtCore import QEvent, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from console.client import AsyncGatewayClient, Supervision
from console.window.monitor_window import MonitorWindow
from console.window.programs import monitor, reading_gamepad
from tests.support.driven_robot import DrivenRobot, driven_robot, free, moving
from tests.support.lost_worker import reset_after_a_loss
from tests.support.promise import MS, keeps
from tests.support.qt import let_pass, until
from tests.support.virtual_pad import VirtualPad, virtual_pad

pytestmark = [pytest.mark.ros, pytest.mark.gst, pytest.mark.timed]

_ATTEMPTS = 5
LET_GO_MS = 60.0
"""From the event on this computer to a zero behind the multiplexer that no motion follows."""


@pytest.fixture(scope="module")
def robot(
    module_ros_domain: int,  # noqa: ARG001  # for its effect
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[DrivenRobot]:
    with driven_robot(tmp_path_factory.mktemp("robot")) as robot:
        yield robot


@dataclass
class Seat:
    """A driver before the window."""

    robot: DrivenRobot
    window: MonitorWindow
    pad: VirtualPad

    def begins(self, hold: Callable[[], None], let_go: Callable[[], None]) -> None:
        """Takes the robot, holds, and lets it come to speed; a machine that is too busy needs another try."""
        let_go()
        self.window.driving.begin(Supervision.LINE_OF_SIGHT, False)
        until(lambda: self.window.driving.hands.pad is not None, "the gamepad")
        for _ in range(_ATTEMPTS):
            asyncio.run(reset(self.robot))
            until(lambda: self.window._worker.driver.view().ready, "the robot may be driven", 30)
            let_pass(0.2)
            hold()
            let_pass(0.6)
            if self.robot.base.moves:
                return
            let_go()
        raise AssertionError(f"it does not drive; it is {self.robot.teleop}")

    def stopped_after_ms(self, act: Callable[[], object]) -> float:
        """Acts, and returns how long the motion lasts after it."""
        with moving(self.robot.base, self.robot.drive):
            since_s = time.monotonic()
            act()
            let_pass(0.5)
            return self.robot.base.stopped_after_s(since_s) * 1000

    def plug_in(self) -> None:
        """Plugs a gamepad in, if none is."""
        if not self.pad.plugged_in:
            self.pad = VirtualPad()

    def presses(self) -> None:
        QTest.keyPress(self.window, Qt.Key.Key_W)

    def lets_go(self) -> None:
        QTest.keyRelease(self.window, Qt.Key.Key_W)

    def holds_the_pad(self) -> None:
        self.pad.deflect(left_y=-1.0)
        self.pad.shoulder(down=True)

    def lets_the_pad_go(self) -> None:
        self.pad.deflect(left_y=0.0)
        self.pad.shoulder(down=False)


@pytest.fixture
def seat(robot: DrivenRobot) -> Iterator[Seat]:
    asyncio.run(free(robot))
    with virtual_pad() as pad, reading_gamepad() as reader, monitor(robot.target, pad=reader) as window:
        window.activateWindow()
        until(window.isActiveWindow, "the window is active")
        until(lambda: window.driving.hands.driveable, "it may be driven")
        seat = Seat(robot, window, pad)
        yield seat
        seat.pad.unplug()


async def reset(robot: DrivenRobot) -> None:
    """Resets a stop that a lost worker of the drive program has left."""
    async with AsyncGatewayClient(robot.target) as client:
        await reset_after_a_loss(client)


def test_a_key_is_released(seat: Seat) -> None:
    def measure() -> float:
        seat.begins(seat.presses, seat.lets_go)
        return seat.stopped_after_ms(seat.lets_go)

    keeps(LET_GO_MS, "ms from the release of a key to zero", measure, per_stalled_s=MS)


def test_the_window_loses_the_focus(seat: Seat) -> None:
    def measure() -> float:
        seat.begins(seat.presses, seat.lets_go)
        lost = QEvent(QEvent.Type.WindowDeactivate)
        found_ms = seat.stopped_after_ms(lambda: QApplication.sendEvent(seat.window, lost))
        QApplication.sendEvent(seat.window, QEvent(QEvent.Type.WindowActivate))
        seat.lets_go()
        return found_ms

    keeps(LET_GO_MS, "ms from the loss of the focus to zero", measure, per_stalled_s=MS)


def test_the_gamepads_shoulder_is_released(seat: Seat) -> None:
    def measure() -> float:
        seat.begins(seat.holds_the_pad, seat.lets_the_pad_go)
        return seat.stopped_after_ms(seat.lets_the_pad_go)

    keeps(LET_GO_MS, "ms from the release of the shoulder button to zero", measure, per_stalled_s=MS)


def test_the_gamepad_is_unplugged(seat: Seat) -> None:
    def measure() -> float:
        seat.plug_in()
        seat.begins(seat.holds_the_pad, seat.lets_the_pad_go)
        return seat.stopped_after_ms(seat.pad.unplug)

    keeps(LET_GO_MS, "ms from the end of the gamepad to zero", measure, per_stalled_s=MS)
