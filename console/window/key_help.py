"""List of the window's keys, shown over the picture."""

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QGridLayout

from console.window.keys import Key
from console.window.labels import PlainLabel, set_bold


class KeyHelp(QFrame):
    """Hidden until it is asked for."""

    def __init__(self) -> None:
        super().__init__()
        self.setAutoFillBackground(True)
        self.setFrameShape(QFrame.Shape.Box)
        self.setVisible(False)

    def fill(self, keys: Sequence[Key]) -> None:
        """Fills the list, in this order; once."""
        self.setAccessibleName("Keys: " + "; ".join(f"{key.shown}: {key.does}" for key in keys))
        grid = QGridLayout(self)
        grid.setContentsMargins(18, 12, 18, 14)
        grid.setHorizontalSpacing(18)
        grid.setVerticalSpacing(3)
        title = PlainLabel("Keys")
        set_bold(title, True)
        grid.addWidget(title, 0, 0, 1, 4)
        half = (len(keys) + 1) // 2
        for number, key in enumerate(keys):
            column, row = divmod(number, half)
            name = PlainLabel(key.shown)
            set_bold(name, True)
            grid.addWidget(name, row + 1, 2 * column, Qt.AlignmentFlag.AlignTop)
            grid.addWidget(PlainLabel(key.does), row + 1, 2 * column + 1)

    def toggle(self) -> None:
        """Shows or hides the list."""
        self.setVisible(self.isHidden())
        self.raise_()
