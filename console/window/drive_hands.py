"""A driver's hands on a window: which keys are down, the gamepad, and when both count for nothing.

The release of a key that goes up while another window has the focus is never reported. So everything is
released as soon as the window, or what has the focus in it, is left, and a key counts again only after a new
press. The window's thread passes on what is held every 10 ms: if it hangs, the session releases after 100 ms
(the hold has lapsed), and afterwards only a new press counts.
"""

import time
from typing import Final, Protocol

from PySide6.QtCore import QEvent, QObject, Qt, QTimer, Signal
from PySide6.QtGui import QGuiApplication, QKeyEvent, QMouseEvent
from PySide6.QtWidgets import QAbstractSpinBox, QApplication, QLineEdit, QPlainTextEdit, QTextEdit, QWidget

from console.client.drive_commands import HOLD_COUNTS_S
from console.monitor.driver import Driver
from console.steering import LETTERS, Direction, Steering, steering_of

TICK_MS: Final = 10
_KEYS: Final = {
    **{Qt.Key(ord(letter.upper())): direction for letter, direction in LETTERS.items()},
    Qt.Key.Key_Up: Direction.FORWARD,
    Qt.Key.Key_Down: Direction.BACK,
    Qt.Key.Key_Left: Direction.TURN_LEFT,
    Qt.Key.Key_Right: Direction.TURN_RIGHT,
}
_KEY_EVENTS: Final = (QEvent.Type.ShortcutOverride, QEvent.Type.KeyPress, QEvent.Type.KeyRelease)
_LEAVING: Final = (
    QEvent.Type.FocusOut,
    QEvent.Type.WindowDeactivate,
    QEvent.Type.WindowBlocked,
)
"""With the hiding of the window itself. A part that hides takes no one away, unless it has the focus."""
_TEXT_FIELDS: Final = (QLineEdit, QTextEdit, QPlainTextEdit, QAbstractSpinBox)
_PLAIN: Final = (
    Qt.KeyboardModifier.ShiftModifier
    | Qt.KeyboardModifier.KeypadModifier
    | Qt.KeyboardModifier.GroupSwitchModifier
)


class Pad(Protocol):
    """A gamepad; `console.gamepad.reader.GamepadReader` is one."""

    def description(self) -> str:
        """Returns which gamepad there is, or why there is none."""

    def problem(self) -> str:
        """Returns why what is held does not count any more, for people; empty without such a reason."""

    def steering(self) -> Steering | None:
        """Returns how it steers; None while it does not hold."""

    def take_stop(self) -> bool:
        """Returns whether its button for STOP was pressed since the last call."""

    def forget(self) -> None:
        """Counts nothing until everything was seen released."""


class DriveHands(QObject):
    """Passes on what is held in one window.

    Args:
        window: whose keys count, while it is active.
        driver: is held and released.
        stop_place: the button STOP of the window.
        pad: a gamepad; None without one.
    """

    stopped = Signal()
    """Space, or the gamepad's button for it, was pressed, or STOP beside an open menu."""
    ticked = Signal()
    """Every 10 ms while `driveable`."""

    def __init__(self, window: QWidget, driver: Driver, stop_place: QWidget, pad: Pad | None = None) -> None:
        super().__init__(window)
        self._window, self._driver, self._stop_place, self.pad = window, driver, stop_place, pad
        self.driveable = False
        """Whether the robot can be driven, so that Space is STOP. Stays as it was while no robot answers."""
        self._down: dict[tuple[int, int], Direction] = {}
        """By the place on the keyboard (`_place`)."""
        self._ticked_s = 0.0
        self._begun = False
        """Whether the robot was ready once in this session: a hold before would have no beginning."""
        self._timer = QTimer(self, interval=TICK_MS, timerType=Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._tick)
        application = QApplication.instance()
        assert isinstance(application, QGuiApplication), "there is a window"  # noqa: S101  # Qt's rule
        application.installEventFilter(self)
        application.applicationStateChanged.connect(self.release)
        self._timer.start()

    def close(self) -> None:
        """Releases, and takes no more keys."""
        self.release()
        self._timer.stop()
        if application := QApplication.instance():
            application.removeEventFilter(self)

    def release(self) -> None:
        """Releases everything. What is still down counts only when it is pressed anew."""
        self._down.clear()
        if self.pad:
            self.pad.forget()
        self._driver.release()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: N802 - Qt's name
        """Takes the keys of driving out of the events of the whole program."""
        kind = event.type()
        if kind in _LEAVING or (kind is QEvent.Type.Hide and watched is self._window):
            if self._is_ours(watched):
                self.release()
            return False
        if kind is QEvent.Type.MouseButtonPress and self._is_on_stop(watched, event):
            self.stopped.emit()
            return False
        if kind not in _KEY_EVENTS or not isinstance(watched, QWidget) or not self._is_ours(watched):
            return False
        assert isinstance(event, QKeyEvent), "by its type"  # noqa: S101  # Qt's rule
        return self._take_key(event)

    def _take_key(self, event: QKeyEvent) -> bool:
        """Returns whether the key was ours. A shortcut with the same key must not act as well."""
        kind, direction = event.type(), _KEYS.get(Qt.Key(event.key()))
        if kind is QEvent.Type.KeyRelease and not event.isAutoRepeat():
            self._let_go(event)
        if self._is_stop(event):
            if kind is QEvent.Type.KeyPress and not event.isAutoRepeat():
                self.stopped.emit()
        elif direction is None or kind is QEvent.Type.KeyRelease or not self._is_for_driving(event):
            return False
        elif kind is QEvent.Type.KeyPress and not event.isAutoRepeat() and self._counts():
            self._down[_place(event)] = direction
            self._pass_on()
        event.accept()
        return True

    def _is_for_driving(self, event: QKeyEvent) -> bool:
        """Whether a letter or arrow steers, and is neither a command nor text."""
        return self._driver.view().open and not (event.modifiers() & ~_PLAIN or _in_text())

    def _let_go(self, event: QKeyEvent) -> None:
        """Takes a release, whatever the key means now, and whatever else is down."""
        if self._down.pop(_place(event), None):
            self._pass_on()

    def _is_stop(self, event: QKeyEvent) -> bool:
        """Whether the key is Space, with any modifier; with one it is text where there is a field for it."""
        return (
            event.key() == Qt.Key.Key_Space
            and self.driveable
            and (event.modifiers() == Qt.KeyboardModifier.NoModifier or not _in_text())
        )

    def _is_on_stop(self, watched: QObject, event: QEvent) -> bool:
        """Whether STOP is pressed beside an open menu, which would take that for a request to close."""
        popup = QApplication.activePopupWidget()
        if popup is None or watched is not popup:
            return False
        assert isinstance(event, QMouseEvent), "by its type"  # noqa: S101  # Qt's rule
        on_stop = QApplication.widgetAt(event.globalPosition().toPoint()) is self._stop_place
        if on_stop:
            # Else some platforms repeat the press for what lies below: one press is one stop.
            popup.setAttribute(Qt.WidgetAttribute.WA_NoMouseReplay)
        return on_stop

    def _is_ours(self, watched: QObject) -> bool:
        """Whether an object belongs to this window, or to a menu or dialog of it."""
        outermost = self._outermost(watched)
        # Once: what passes its focus on to a part of its own would lead back to itself.
        return self._window in (outermost, self._outermost(_field_of(outermost)))

    def _outermost(self, watched: QObject | None) -> QObject | None:
        """Returns this window where it is around an object, else the last one that is; None for None."""
        each = watched
        while each is not None and each is not self._window and (parent := each.parent()):
            each = parent
        return each

    def _counts(self) -> bool:
        """Whether what is held in this window counts."""
        return (
            self._window.isActiveWindow()
            and QGuiApplication.applicationState() is Qt.ApplicationState.ApplicationActive
            and QApplication.activeModalWidget() is None
            and QApplication.activePopupWidget() is None
        )

    def _tick(self) -> None:
        now_s = time.monotonic()
        hung, self._ticked_s = now_s - self._ticked_s > HOLD_COUNTS_S, now_s
        if not self.driveable:
            return
        if hung:
            # The session has released; going on now would be motion without a new hold.
            self.release()
        if self.pad and self.pad.take_stop():
            self.stopped.emit()
        self._pass_on()
        self.ticked.emit()

    def _pass_on(self) -> None:
        view = self._driver.view()
        self._begun = view.open and (self._begun or view.ready)
        if view.lapsed or not (view.open and self._counts()):
            self.release()
            return
        by_pad = self.pad.steering() if self.pad else None
        steering = by_pad or steering_of(self._down.values())
        if steering is None or not self._begun:
            self._driver.release()
        else:
            self._driver.hold(steering, "gamepad" if by_pad else "keyboard")


def _field_of(watched: QObject | None) -> QObject | None:
    """Returns the text field of a list of suggestions, which has no parent; None for anything else."""
    return watched.focusProxy() if isinstance(watched, QWidget) else None


def _place(event: QKeyEvent) -> tuple[int, int]:
    """Returns which key of the keyboard it is; what it means may change before it is released.

    With AltGr, Shift, NumLock or another layout the same key is another one to Qt. Where the platform has no
    codes of keys there is only its meaning.
    """
    code = event.nativeScanCode()
    return (code, 0) if code else (0, event.key())


def _in_text() -> bool:
    return isinstance(QApplication.focusWidget(), _TEXT_FIELDS)
