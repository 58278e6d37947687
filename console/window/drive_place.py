"""The place of driving in the bottom strip, on robots that can be driven: limits, Drive, Reset, STOP."""

from functools import partial
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QColor, QPalette
from PySide6.QtWidgets import QHBoxLayout, QMenu, QPushButton, QToolButton, QVBoxLayout, QWidget

from console.client import StopLatch, Supervision
from console.client.results import Teleop, TeleopState
from console.monitor.driver import DriverView
from console.presentation.formatting import quantity
from console.presentation.severity_style import SeverityStyle
from console.window.cell import SmallLabel
from console.window.labels import PlainLabel, set_bold, set_text
from console.window.layout import fill
from console.window.theme import COLOURS

_STOP_WIDTH_PX: Final = 132
_STOP_HEIGHT_PX: Final = 48
_BUTTON_HEIGHT_PX: Final = 23
_TEXTS_WIDTH_PX: Final = 132
_STOP_FONT_FACTOR: Final = 1.9
_MENU_BESIDE: Final = QToolButton.ToolButtonPopupMode.MenuButtonPopup
_MENU_ONLY: Final = QToolButton.ToolButtonPopupMode.InstantPopup
_INK: Final = QColor("#000000")
"""On vermillion: a contrast of 5 or more (theme.py)."""


class DrivePlace(QWidget):
    """What the robot permits, a driver's buttons, and at the right end, where nothing moves it, STOP.

    STOP is for callers of every role: it needs no driver and no lease.
    """

    stop_pressed = Signal()
    drive_pressed = Signal()
    """Begins driving by the picture, or ends driving."""
    reset_pressed = Signal(int)
    """With the number of the stop that was shown."""
    begin_chosen = Signal(object, bool)
    """An entry of the menu: with the Supervision, and whether to take over."""
    enabled_chosen = Signal(bool)
    """An entry of the menu: whether driving is to be enabled, for all."""

    def __init__(self) -> None:
        super().__init__()
        self.state, self.limits = PlainLabel(), SmallLabel()
        set_bold(self.state, True)
        self.drive, self.reset, self.stop_place = QToolButton(), QPushButton("Reset"), _StopButton()
        self._latch: StopLatch | None = None
        self._lay_out()
        self.stop_place.pressed.connect(self.stop_pressed)
        self.drive.clicked.connect(self.drive_pressed)
        self.reset.clicked.connect(self.press_reset)
        self.setVisible(False)

    def show_teleop(
        self, teleop: Teleop, view: DriverView, latch: StopLatch | None, *, known: bool = True
    ) -> None:
        """Shows the robot's limits and what can be pressed; nothing on a robot without teleoperation.

        Args:
            teleop: of the status.
            view: of this window's own driving.
            latch: the stop that is shown, and that Reset is for.
            known: whether the robot answers; else all this is what was last known. STOP works in any case.
        """
        last_known = "" if known else ", last known"
        self.setVisible(teleop.state is not TeleopState.UNKNOWN)
        set_text(self.state, f"Driving {teleop.state.value}{last_known}")
        linear, angular = quantity(teleop.max_linear_mps, "m/s"), quantity(teleop.max_angular_rad_s, "rad/s")
        set_text(self.limits, f"at most {linear}, {angular}")
        self.setAccessibleName(f"{self.state.text()}, {self.limits.text()}")
        set_text(self.drive, "End driving" if view.open else "Opening ..." if view.opening else "Drive")
        self.drive.setEnabled(view.open or (known and not view.opening))
        # Where driving is disabled, all there is to choose is in the menu: to enable it.
        self.drive.setPopupMode(_MENU_BESIDE if view.open or teleop.enabled else _MENU_ONLY)
        self.enable.setEnabled(known and not teleop.enabled)
        self.disable.setEnabled(known and teleop.enabled)
        for entry in self.begins:
            entry.setEnabled(known and teleop.enabled and not (view.open or view.opening))
        self._latch = latch
        set_text(self.reset, f"Reset stop {latch.stop_id}" if latch else "Reset")
        self.reset.setEnabled(latch is not None)
        self.stop_place.show_pending(view.stopping)

    def show_pad(self, description: str) -> None:
        """Says in the menu which gamepad there is."""
        text = f"Gamepad: {description}".replace("&", "&&")
        if self.pad.text() != text:
            self.pad.setText(text)

    def press_reset(self) -> None:
        """Resets the stop that is shown; no-op without one."""
        if self._latch:
            self.reset_pressed.emit(self._latch.stop_id)

    def _lay_out(self) -> None:
        self.drive.setMenu(self._menu())
        self.drive.setPopupMode(_MENU_BESIDE)
        self.drive.setToolTip("Key T: take the robot to drive it, or give it back")
        self.drive.setAccessibleName("Drive")
        self.drive.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.reset.setToolTip("Key Shift+R: reset this stop. Nothing moves by it")
        self.limits.setMinimumWidth(_TEXTS_WIDTH_PX)
        widest = QPushButton("Reset stop 9999").sizeHint().width()
        for button in (self.drive, self.reset):
            button.setFixedSize(widest, _BUTTON_HEIGHT_PX)
        texts = QVBoxLayout()
        texts.addStretch(1)
        fill(texts, self.state, self.limits, spacing=0).addStretch(1)
        buttons = fill(QVBoxLayout(), self.drive, self.reset, spacing=2)
        fill(QHBoxLayout(self), texts, buttons, self.stop_place, spacing=8)

    def _menu(self) -> QMenu:
        menu = QMenu(self)
        by_picture, by_eye = Supervision.PICTURE, Supervision.LINE_OF_SIGHT
        self.begins = [
            menu.addAction(text, partial(self.begin_chosen.emit, supervision, take_over))
            for text, supervision, take_over in (
                ("Drive by the picture", by_picture, False),
                ("Drive by line of sight, slowly", by_eye, False),
                ("Take over from another driver", by_picture, True),
                ("Take over, by line of sight", by_eye, True),
            )
        ]
        menu.addSeparator()
        self.enable, self.disable = (
            menu.addAction(text, partial(self.enabled_chosen.emit, enabled))
            for text, enabled in (("Enable driving, for all", True), ("Disable driving, for all", False))
        )
        menu.addSeparator()
        self.pad = menu.addAction("Gamepad: none")
        self.pad.setEnabled(False)
        return menu


class _StopButton(QPushButton):
    """Acts when it is pressed, not when it is released."""

    def __init__(self) -> None:
        super().__init__("STOP")
        self.setFixedSize(_STOP_WIDTH_PX, _STOP_HEIGHT_PX)
        self.setToolTip("Key Space: the robot stops until this stop is reset. Its motors stay powered")
        self.setAccessibleName("STOP: the robot stops until this stop is reset")
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        font = self.font()
        font.setPointSizeF(font.pointSizeF() * _STOP_FONT_FACTOR)
        font.setBold(True)
        self.setFont(font)
        palette = self.palette()
        palette.setColor(QPalette.ColorRole.Button, COLOURS[SeverityStyle.BAD])
        palette.setColor(QPalette.ColorRole.ButtonText, _INK)
        self.setPalette(palette)

    def show_pending(self, pending: bool) -> None:
        """Shows whether the robot has yet to confirm a stop. The button works all the time."""
        set_text(self, "STOP ..." if pending else "STOP")
