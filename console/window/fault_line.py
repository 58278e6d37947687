"""Line of one fault: what it is, what to do, and its acknowledgement."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QPushButton

from console.monitor.status_rows import FaultItem
from console.presentation.severity_style import SeverityStyle
from console.window.cell import SmallLabel
from console.window.labels import PlainLabel, WrappedLabel, set_bold, set_text
from console.window.layout import fill
from console.window.lines import TintedLine
from console.window.theme import DimLabel


class FaultLine(TintedLine):
    """An active fault with its remedy; a cleared one as one grey line."""

    acknowledged = Signal(object)
    """The button was pressed; with the FaultItem."""

    def __init__(self) -> None:
        super().__init__()
        self._item: FaultItem | None = None
        self.mark, self.age, self.summary = PlainLabel(), DimLabel(), SmallLabel()
        self.text, self.remedy = WrappedLabel(), WrappedLabel()
        self.button = QPushButton("Acknowledge")
        self.button.setToolTip("Mutes the alarm for this fault; A: for all")
        self.button.clicked.connect(lambda: self.acknowledged.emit(self._item))
        head = fill(QHBoxLayout(), self.mark, self.age, (self.summary, 1), self.button, spacing=8)
        self.grid.addLayout(head, 0, 1)
        self.grid.addWidget(self.text, 1, 1)
        self.grid.addWidget(self.remedy, 2, 1)
        self.grid.setColumnStretch(1, 1)

    def show_item(self, item: FaultItem) -> None:
        """Shows one fault."""
        row, self._item = item.row, item
        self.show_style(row.style)
        plain = row.style in (SeverityStyle.QUIET, SeverityStyle.GOOD)
        set_text(self.mark, row.mark)
        set_bold(self.mark, not plain)
        set_text(self.text, row.text)
        set_text(self.remedy, row.remedy)
        set_text(self.age, row.age)
        set_text(self.summary, row.text if plain else "")
        self.text.setHidden(plain)
        self.age.setHidden(plain)
        self.remedy.setVisible(bool(row.remedy) and not plain)
        self.button.setVisible(item.pending)
        self.button.setAccessibleName(f"Acknowledge: {row.text}")
        self.setAccessibleName(f"{row.mark}. {row.text}. {row.remedy or row.age}")
