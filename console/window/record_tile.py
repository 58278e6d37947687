"""State of the recorder over the picture: that it records, and that the disk fills or fails."""

from PySide6.QtWidgets import QVBoxLayout, QWidget

from console.monitor.bar_items import BarItem
from console.presentation.severity_style import SeverityStyle
from console.window.cell import Cell
from console.window.layout import fill
from console.window.theme import COCKPIT, Marker


class RecordTile(QWidget):
    """Shown while a recording runs, and while something is wrong; it stays in the picture alone, too."""

    def __init__(self) -> None:
        super().__init__()
        self.setPalette(COCKPIT)
        self.setAutoFillBackground(True)
        self.cell = Cell("Recording", ("FINALISING", "room 99 h 59 min"), Marker())
        fill(QVBoxLayout(self), self.cell, margins=(8, 0, 8, 0))
        self.setVisible(False)

    def show_item(self, item: BarItem | None) -> None:
        """Shows the latest item; None without a recorder."""
        self.setVisible(item is not None and item.style is not SeverityStyle.QUIET)
        if item:
            self.cell.show_item(item)
