"""Driving in the cockpit: a real gateway and drive program, and a base that listens."""

import functools
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import ParamSpec

import pytest
from PySide6.QtCore import QEvent, QPoint, Qt
from PySide6.QtGui import QGuiApplication, QKeyEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QDialog, QLineEdit, QWidget

from console.client import Supervision
from console.monitor.recorder_controls import Action, RecordingItem
from console.presentation.severity_style import SeverityStyle
from console.steering import Steering
from console.window.monitor_window import MonitorWindow
from console.window.programs import monitor
from tests.support.driven_robot import DrivenRobot, driven_robot, drives_undisturbed
from tests.support.qt import keep_screenshot, let_pass, press, until
from tests.support.uploading import recording

pytestmark = [pytest.mark.ros, pytest.mark.gst]

P = ParamSpec("P")

BY_EYE = Supervision.LINE_OF_SIGHT
LISTED = RecordingItem(
    recording=recording("one", {}),
    title="lap 1",
    facts="12 s",
    state="complete",
    style=SeverityStyle.GOOD,
    tip="",
    picture=None,
    export=Action("Export"),
    pin=Action("Pin"),
    delete=Action("Delete ..."),
)
"""A recording in the list of the recordings."""
BY_EYE_MPS = 0.15
"""What line of sight permits."""


@pytest.fixture(scope="module")
def robot(
    module_ros_domain: int,  # noqa: ARG001  # for its effect
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[DrivenRobot]:
    with driven_robot(tmp_path_factory.mktemp("robot")) as robot:
        yield robot


@dataclass
class PlayedPad:
    """A gamepad in the test's hands."""

    steers: Steering | None = None
    stop: bool = False
    forgotten: int = 0

    why_not: str = ""

    def description(self) -> str:
        return "played & tested"

    def problem(self) -> str:
        return self.why_not

    def steering(self) -> Steering | None:
        return self.steers

    def take_stop(self) -> bool:
        pressed, self.stop = self.stop, False
        return pressed

    def forget(self) -> None:
        self.forgotten += 1


@dataclass
class Seat:
    """A driver in front of a window, for as long as `taken` lasts."""

    robot: DrivenRobot
    _window: MonitorWindow | None = None

    @property
    def window(self) -> MonitorWindow:
        assert self._window
        return self._window

    @contextmanager
    def taken(self) -> Iterator[None]:
        """Opens a window; the robot is at rest and free when it is closed again."""
        with monitor(self.robot.target) as self._window:
            self.window.activateWindow()
            until(self.window.isActiveWindow, "the window is active")
            until(self.window.strip.driving.isVisible, "the place of driving")
            yield
        until(lambda: not self.robot.base.moves, "a closed window drives nothing")
        until(lambda: not self.robot.teleop.holder, "nor keeps it the robot")

    def ready(self) -> None:
        """Takes the robot; the next hold moves it."""
        self.window.driving.begin(BY_EYE, False)
        until(lambda: self.window._worker.driver.view().ready, "the robot may be driven")
        let_pass(0.1)

    def key(self, key: Qt.Key, *, down: bool) -> None:
        """Presses or releases a key, in what has the focus."""
        (QTest.keyPress if down else QTest.keyRelease)(QApplication.focusWidget() or self.window, key)

    def repeats(self, key: Qt.Key) -> None:
        """The desktop repeats a key that is down: X11 sends both, marked as repeated."""
        target = QApplication.focusWidget() or self.window
        for kind in (QEvent.Type.KeyRelease, QEvent.Type.KeyPress):
            QApplication.sendEvent(target, QKeyEvent(kind, key, Qt.KeyboardModifier.NoModifier, "", True))

    def moves(self) -> None:
        until(lambda: self.robot.base.moves, "the base moves")

    def rests(self) -> None:
        until(lambda: not self.robot.base.moves, "the base is at rest")
        before = len(self.robot.base.heard)
        let_pass(0.3)
        assert not any(each.moves for each in self.robot.base.heard[before:])

    def shown(self) -> str:
        return self.window.picture.hud.accessibleName()

    def note(self, words: str) -> str:
        return until(lambda: next((n.text for n in self.window.toasts.notes if words in n.text), ""), words)


@pytest.fixture
def seat(robot: DrivenRobot) -> Seat:
    return Seat(robot)


def seated(test: Callable[P, None]) -> Callable[P, None]:
    """A test in a seat that is taken; begun anew where a stall has cost the driver the robot."""

    @functools.wraps(test)
    def begun_anew(*args: P.args, **fixtures: P.kwargs) -> None:
        seat = fixtures["seat"]
        assert isinstance(seat, Seat)

        def attempt() -> None:
            with seat.taken():
                test(*args, **fixtures)

        drives_undisturbed(seat.robot, attempt)

    return begun_anew


# The base must still move a moment later: where its driver is late by 250 ms, the robot stops.
@pytest.mark.timed
@seated
def test_a_key_moves_the_robot_while_it_is_down(seat: Seat) -> None:
    seat.ready()
    seat.key(Qt.Key.Key_W, down=True)
    seat.moves()
    until(lambda: seat.robot.base.heard[-1].vx_mps == pytest.approx(BY_EYE_MPS), "full speed")
    for _ in range(3):
        seat.repeats(Qt.Key.Key_W)
        let_pass(0.05)
    assert seat.robot.base.moves, "repeats are neither presses nor releases"
    until(lambda: "DRIVING" in seat.shown(), "the phase")
    assert "You drive, by line of sight" in seat.shown()
    keep_screenshot(seat.window, "driving-by-eye")
    seat.key(Qt.Key.Key_W, down=False)
    seat.rests()
    assert seat.robot.teleop.holder
    press(seat.window, Qt.Key.Key_T)
    until(lambda: not seat.robot.teleop.holder, "the lease is given back")


@seated
def test_the_end_of_driving_releases_what_is_down(seat: Seat, monkeypatch: pytest.MonkeyPatch) -> None:
    """Until the session has ended, the window would hold anew with each tick."""
    seat.ready()
    hands, driver = seat.window.driving.hands, seat.window._worker.driver
    end, down = driver.end, list[int]()

    def seen_end() -> None:
        down.append(len(hands._down))
        end()

    monkeypatch.setattr(driver, "end", seen_end)
    seat.key(Qt.Key.Key_W, down=True)
    seat.moves()
    press(seat.window, Qt.Key.Key_T)
    seat.key(Qt.Key.Key_W, down=False)
    until(lambda: not seat.robot.teleop.holder, "the lease is given back")
    assert down == [0]


PLACE = 26
"""Of E on a keyboard of a PC under X11."""
EURO_SIGN, CYRILLIC_U = Qt.Key(0x20AC), Qt.Key(0x0423)
"""Qt names characters by their code points."""
PLAIN, SHIFT = Qt.KeyboardModifier.NoModifier, Qt.KeyboardModifier.ShiftModifier
ALT_GR = Qt.KeyboardModifier.GroupSwitchModifier
CONTROL, ALT = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.AltModifier
META, KEYPAD = Qt.KeyboardModifier.MetaModifier, Qt.KeyboardModifier.KeypadModifier
MEANINGS = [
    pytest.param(Qt.Key.Key_E, PLAIN, EURO_SIGN, ALT_GR, id="AltGr"),
    pytest.param(Qt.Key.Key_E, PLAIN, CYRILLIC_U, PLAIN, id="another layout"),
    pytest.param(Qt.Key.Key_Up, KEYPAD, Qt.Key.Key_8, KEYPAD, id="NumLock"),
    pytest.param(Qt.Key.Key_E, PLAIN, Qt.Key.Key_E, CONTROL | SHIFT, id="Control and Shift"),
]


@pytest.mark.parametrize(("pressed", "with_", "released", "then_with"), MEANINGS)
@seated
def test_a_key_whose_meaning_has_changed_is_released(
    seat: Seat,
    pressed: Qt.Key,
    with_: Qt.KeyboardModifier,
    released: Qt.Key,
    then_with: Qt.KeyboardModifier,
) -> None:
    seat.ready()
    for kind, key, modifiers in (
        (QEvent.Type.KeyPress, pressed, with_),
        (QEvent.Type.KeyRelease, released, then_with),
    ):
        target = QApplication.focusWidget() or seat.window
        QApplication.sendEvent(target, QKeyEvent(kind, key, modifiers, PLACE, 0, 0))
        if kind is QEvent.Type.KeyPress:
            seat.moves()
    until(lambda: not seat.robot.base.moves, "the base is at rest", 2)
    seat.rests()


# The base must still move a moment later: where its driver is late by 250 ms, the robot stops.
@pytest.mark.timed
@seated
def test_another_key_that_goes_up_releases_none(seat: Seat) -> None:
    seat.ready()
    target = QApplication.focusWidget() or seat.window
    for place in (PLACE, PLACE + 1):
        QApplication.sendEvent(target, QKeyEvent(QEvent.Type.KeyPress, Qt.Key.Key_W, PLAIN, place, 0, 0))
    seat.moves()
    for place in (PLACE, PLACE + 2):
        QApplication.sendEvent(target, QKeyEvent(QEvent.Type.KeyRelease, Qt.Key.Key_W, PLAIN, place, 0, 0))
    let_pass(0.3)
    assert seat.robot.base.moves
    QApplication.sendEvent(target, QKeyEvent(QEvent.Type.KeyRelease, Qt.Key.Key_W, PLAIN, PLACE + 1, 0, 0))
    seat.rests()


@pytest.mark.parametrize("modifiers", [SHIFT, CONTROL, ALT, META, KEYPAD, ALT_GR, SHIFT | CONTROL])
@seated
def test_space_stops_whatever_else_is_down(seat: Seat, modifiers: Qt.KeyboardModifier) -> None:
    seat.ready()
    seat.key(Qt.Key.Key_W, down=True)
    seat.moves()
    QTest.keyPress(QApplication.focusWidget() or seat.window, Qt.Key.Key_Space, modifiers)
    until(lambda: seat.robot.teleop.HasField("stop"), "a stop")
    seat.rests()


@seated
def test_shift_and_space_are_a_space_in_a_text(seat: Seat) -> None:
    seat.window.search_events()
    search = until(lambda: seat.window.side.events_tab.search, "the field")
    until(search.hasFocus, "it has the focus")
    QTest.keyClick(search, Qt.Key.Key_Space, SHIFT)
    assert search.text() == " "
    let_pass(0.3)
    assert not seat.robot.teleop.HasField("stop")


def leaves_for_a_text(seat: Seat) -> None:
    seat.window.search_events()


def leaves_for_another_window(seat: Seat) -> None:
    other = QWidget(seat.window, Qt.WindowType.Window)
    other.show()
    other.activateWindow()
    until(other.isActiveWindow, "another window is active")
    let_pass(0.3)
    assert not seat.robot.base.moves
    other.close()
    seat.window.activateWindow()
    until(seat.window.isActiveWindow, "the window is active again")


def leaves_for_a_dialog(seat: Seat) -> None:
    dialog = QDialog(seat.window)
    dialog.open()
    let_pass(0.3)
    assert not seat.robot.base.moves
    dialog.close()
    seat.window.activateWindow()
    until(seat.window.isActiveWindow, "the window is active again")


def leaves_for_a_menu(seat: Seat) -> None:
    menu = seat.window.strip.driving.drive.menu()
    menu.popup(seat.window.mapToGlobal(QPoint(50, 50)))
    let_pass(0.3)
    assert not seat.robot.base.moves
    menu.close()


def leaves_the_program(_seat: Seat) -> None:
    application = QApplication.instance()
    assert isinstance(application, QApplication)
    application.applicationStateChanged.emit(Qt.ApplicationState.ApplicationInactive)


@pytest.mark.parametrize(
    "leave",
    [
        leaves_for_a_text,
        leaves_for_another_window,
        leaves_for_a_dialog,
        leaves_for_a_menu,
        leaves_the_program,
    ],
)
@seated
def test_what_takes_the_driver_away_releases_everything(seat: Seat, leave: Callable[[Seat], None]) -> None:
    seat.ready()
    seat.key(Qt.Key.Key_Up, down=True)
    seat.moves()
    leave(seat)
    seat.rests()
    seat.repeats(Qt.Key.Key_Up)
    let_pass(0.3)
    assert not seat.robot.base.moves, "the key is still down, and counts only when it is pressed anew"


@seated
def test_a_window_that_hangs_drives_nothing(seat: Seat) -> None:
    seat.ready()
    seat.key(Qt.Key.Key_W, down=True)
    seat.moves()
    hung_s = time.monotonic()
    time.sleep(1.0)  # the window's thread hangs; the base listens in another one
    assert not seat.robot.base.moves
    assert seat.robot.base.stopped_after_s(hung_s) < 0.6
    let_pass(0.5)
    assert not seat.robot.base.moves, "the key is still down, and counts only when it is pressed anew"


@seated
def test_a_hold_that_lapses_although_the_window_goes_on_counts_when_it_is_pressed_anew(seat: Seat) -> None:
    seat.ready()
    seat.key(Qt.Key.Key_W, down=True)
    seat.moves()
    time.sleep(0.3)
    seat.window.driving.hands._ticked_s = time.monotonic()  # so that the window itself notices nothing
    until(lambda: not seat.window.driving.hands._down, "the key counts no more")
    seat.rests()
    seat.key(Qt.Key.Key_W, down=False)
    seat.key(Qt.Key.Key_W, down=True)
    seat.moves()


@seated
def test_a_gamepad_drives_while_it_holds_and_stops_the_robot(seat: Seat) -> None:
    pad = PlayedPad()
    seat.window.driving.hands.pad = pad
    seat.ready()
    assert pad.forgotten, "what it held before counts for nothing"
    pad.steers = Steering(0.0, 0.0, -0.5)
    seat.moves()
    until(lambda: seat.robot.base.heard[-1].wz_rad_s == pytest.approx(-0.2), "half of what is permitted")
    pad.steers = None
    seat.rests()
    pad.steers = Steering(1.0, 0.0, 0.0)
    seat.moves()
    pad.stop = True
    # Before that, a window that waits for a processor may have it at rest for a moment.
    until(lambda: "STOPPED" in seat.shown(), "the phase")
    seat.rests()


@seated
def test_a_gamepad_that_holds_no_more_is_reported_once(seat: Seat) -> None:
    pad = PlayedPad(why_not="it has fallen asleep")
    seat.window.driving.hands.pad = pad
    seat.note("it has fallen asleep")
    let_pass(0.5)
    assert sum("it has fallen asleep" in note.text for note in seat.window.toasts.notes) == 1


@seated
def test_stop_is_for_anyone_and_the_latch_that_is_shown_is_reset(seat: Seat) -> None:
    reset = seat.window.strip.driving.reset
    assert not reset.isEnabled()
    seat.key(Qt.Key.Key_Space, down=True)
    seat.note("Stopped")
    until(lambda: "STOPPED" in seat.shown(), "the phase")
    assert "by STOP in the monitor" in seat.shown()
    until(reset.isEnabled, "it may be reset")
    assert reset.text() == f"Reset stop {seat.robot.teleop.stop.stop_id}"
    keep_screenshot(seat.window, "driving-stopped")
    press(seat.window, Qt.Key.Key_R, Qt.KeyboardModifier.ShiftModifier)
    until(lambda: not seat.robot.teleop.HasField("stop"), "the stop is reset")
    until(lambda: not reset.isEnabled(), "nothing to reset")


def in_the_search(seat: Seat) -> None:
    seat.window.search_events()


def on_a_button(seat: Seat) -> None:
    seat.window.preview.switch.setFocus()


def in_the_picture_alone(seat: Seat) -> None:
    press(seat.window, Qt.Key.Key_F)


def in_the_full_screen(seat: Seat) -> None:
    press(seat.window, Qt.Key.Key_F11)


def under_the_list_of_keys(seat: Seat) -> None:
    press(seat.window, Qt.Key.Key_F1)


def under_a_question(seat: Seat) -> None:
    seat.window.recording.delete(LISTED)
    question = until(lambda: seat.window.recording.question, "a confirmation")
    until(question.isActiveWindow, "it has the keys")


def under_a_file_dialog(seat: Seat) -> None:
    seat.window.recording.choose_folder()
    dialog = until(lambda: seat.window.recording.folder_dialog, "the dialog")
    until(dialog.isActiveWindow, "it has the keys")


def under_suggestions_of_a_file_dialog(seat: Seat) -> None:
    suggested = seat.window.recording.folder = Path(os.environ["XDG_CONFIG_HOME"])
    (suggested / "lab").mkdir(exist_ok=True)
    under_a_file_dialog(seat)
    dialog = seat.window.recording.folder_dialog
    assert dialog

    def suggests() -> bool:
        if QApplication.activePopupWidget() is None:
            # Names that could not be listed in time for a letter are suggested for the same one, not for two.
            for field in dialog.findChildren(QLineEdit):
                field.clear()
            QTest.keyClick(QGuiApplication.focusWindow(), Qt.Key.Key_L)
            let_pass(0.2)
        return QApplication.activePopupWidget() is not None

    until(suggests, "the names that begin so")


def in_a_menu(seat: Seat) -> None:
    seat.window.strip.driving.drive.menu().popup(seat.window.mapToGlobal(QPoint(50, 50)))
    until(QApplication.activePopupWidget, "the menu")


def in_the_list_of_robots(seat: Seat) -> None:
    robots = seat.window.header.name.robots
    robots.popup(seat.window.mapToGlobal(QPoint(50, 50)))
    until(QApplication.activePopupWidget, "the list")


@pytest.mark.parametrize(
    "somewhere",
    [
        in_the_search,
        on_a_button,
        in_the_picture_alone,
        in_the_full_screen,
        under_the_list_of_keys,
        under_a_question,
        under_a_file_dialog,
        under_suggestions_of_a_file_dialog,
        in_a_menu,
        in_the_list_of_robots,
    ],
)
@seated
def test_space_and_the_button_stop_in_every_state_of_the_window(
    seat: Seat, somewhere: Callable[[Seat], None]
) -> None:
    """Key and button go through the window system, as a person's do: what blocks a window blocks them."""
    somewhere(seat)
    let_pass(0.2)
    stop = seat.window.strip.driving.stop_place
    assert stop.isVisible()
    place = stop.mapTo(seat.window, stop.rect().center())

    def by_key() -> None:
        QTest.keyPress(QGuiApplication.focusWindow(), Qt.Key.Key_Space)

    def by_mouse() -> None:
        handle, none = seat.window.windowHandle(), Qt.KeyboardModifier.NoModifier
        QTest.mousePress(handle, Qt.MouseButton.LeftButton, none, place)
        QTest.mouseRelease(handle, Qt.MouseButton.LeftButton, none, place)

    def is_reset() -> bool:
        # So soon after its start the drive program refuses: it does not know yet what else there is.
        seat.window.driving.reset()
        let_pass(0.3)
        return not seat.robot.teleop.HasField("stop")

    for act in (by_key, by_mouse):
        act()
        until(lambda: seat.robot.teleop.HasField("stop"), "a stop")
        shown = f"Reset stop {seat.robot.teleop.stop.stop_id}"
        until(lambda: seat.window.strip.driving.reset.text() == shown, "it is shown")  # noqa: B023  # at once
        until(is_reset, "it is reset")
    assert not any(" " in field.text() for field in seat.window.findChildren(QLineEdit)), "Space is no text"


@seated
def test_letters_drive_instead_of_their_other_meanings(seat: Seat) -> None:
    seat.ready()
    seat.key(Qt.Key.Key_Q, down=True)
    seat.moves()
    until(lambda: seat.robot.base.heard[-1].vy_mps > 0, "to the left")
    assert seat.window.isVisible()
    seat.key(Qt.Key.Key_Q, down=False)
    seat.rests()
    press(seat.window, Qt.Key.Key_Q, Qt.KeyboardModifier.ControlModifier)
    assert seat.window.isVisible()


@seated
def test_without_a_picture_nothing_moves_and_the_reason_is_shown(seat: Seat) -> None:
    press(seat.window, Qt.Key.Key_T)
    until(lambda: "There is no picture" in seat.shown(), "why")
    seat.key(Qt.Key.Key_W, down=True)
    let_pass(0.5)
    assert not seat.robot.base.moves
    assert "You drive" in seat.shown()


@seated
def test_another_ones_driving_is_shown_and_a_refusal_said(seat: Seat) -> None:
    with monitor(seat.robot.target) as other:
        until(lambda: other.driving.hands.driveable, "it may be driven")
        other.driving.begin(BY_EYE, False)
        until(lambda: "drives" in seat.shown() and "You" not in seat.shown(), "who drives")
        seat.window.driving.begin(BY_EYE, False)
        seat.note("Not driving")
        until(lambda: not seat.window._worker.driver.view().opening, "it is not asked for any more")
    until(lambda: "No driver" in seat.shown(), "no one drives")
