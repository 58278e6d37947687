"""The strip below picture and side panel: the preview's controls, and the place of driving."""

from typing import Final

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QWidget

from console.client import StopLatch
from console.client.results import Teleop
from console.monitor.driver import DriverView
from console.window.drive_place import DrivePlace
from console.window.layout import fill
from console.window.preview_panel import PreviewPanel
from console.window.theme import COCKPIT

_HEIGHT_PX: Final = 40
_HEIGHT_WITH_DRIVING_PX: Final = 56


class BottomStrip(QWidget):
    """As wide as the window, whether the side panel is open or not: STOP's place never moves."""

    arranged = Signal()
    """The strip has another height now."""

    def __init__(self) -> None:
        super().__init__()
        self.setPalette(COCKPIT)
        self.setAutoFillBackground(True)
        self.preview, self.driving = PreviewPanel(), DrivePlace()
        fill(QHBoxLayout(self), (self.preview, 1), self.driving, spacing=20, margins=(8, 4, 8, 4))
        self.setFixedHeight(_HEIGHT_PX)

    def show_teleop(
        self, teleop: Teleop, view: DriverView, latch: StopLatch | None, *, known: bool = True
    ) -> None:
        """Makes room for driving on a robot that has it; see `DrivePlace.show_teleop`."""
        self.driving.show_teleop(teleop, view, latch, known=known)
        self._arrange()

    def show_preview(self, shown: bool) -> None:
        """Shows or hides the preview's controls; the strip stays as long as there is driving."""
        self.preview.setVisible(shown)
        self._arrange()

    def _arrange(self) -> None:
        driving = not self.driving.isHidden()
        height = _HEIGHT_WITH_DRIVING_PX if driving else _HEIGHT_PX
        self.setVisible(driving or not self.preview.isHidden())
        if height != self.maximumHeight():
            self.setFixedHeight(height)
            self.arranged.emit()
