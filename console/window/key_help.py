"""List of the window's keys, shown over the picture."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import QApplication, QFrame, QGridLayout, QScrollArea, QVBoxLayout, QWidget
from shiboken6 import isValid

from console.window.keys import Key
from console.window.labels import PlainLabel, set_bold
from console.window.layout import fill

_MARGINS: Final = (18, 12, 6, 14)
_SPACING_PX: Final = 6
_BETWEEN_COLUMNS_PX: Final = 18
_BETWEEN_ROWS_PX: Final = 3


class KeyHelp(QFrame):
    """Hidden until it is asked for. Two columns where there is room for them, else one, which scrolls.

    While it is shown it has the focus, so that the arrows and Page Down scroll it.
    """

    def __init__(self) -> None:
        super().__init__()
        self.setAutoFillBackground(True)
        self.setFrameShape(QFrame.Shape.Box)
        self.setVisible(False)
        self._keys: Sequence[Key] = ()
        self._columns = 0
        self._widest_px = 0
        """Width of both columns beside each other."""
        self._before: QWidget | None = None
        """What had the focus before."""
        self._title, self.area, self._content = PlainLabel("Keys"), QScrollArea(), QWidget()
        set_bold(self._title, True)
        self.area.setFrameShape(QFrame.Shape.NoFrame)
        self.area.setWidgetResizable(True)
        self.area.setAccessibleName("Keys")
        fill(QVBoxLayout(self), self._title, (self.area, 1), spacing=_SPACING_PX, margins=_MARGINS)

    def fill(self, keys: Sequence[Key]) -> None:
        """Fills the list, in this order; once."""
        self.setAccessibleName("Keys: " + "; ".join(f"{key.shown}: {key.does}" for key in keys))
        self._keys, self._columns = keys, 0
        self._arrange_in(2)
        self._widest_px = self._natural_size().width()

    def fit(self, room: QSize) -> None:
        """Takes the middle of a room of this size, in as many columns as it has the width for."""
        self._arrange_in(2 if self._widest_px <= room.width() else 1)
        size = self._natural_size().boundedTo(room)
        left, top = (room.width() - size.width()) // 2, (room.height() - size.height()) // 2
        self.setGeometry(left, top, size.width(), size.height())

    def toggle(self) -> None:
        """Shows the list and gives it the focus, or hides it and gives the focus back."""
        if self.isHidden():
            self._before = QApplication.focusWidget()
            self.show()
            self.raise_()
            self.area.setFocus()
            return
        focused = self.window().focusWidget() is self.area
        # Else Qt gives it to the next part of the window, which may be a text field.
        self.area.clearFocus()
        self.hide()
        if focused and self._before and isValid(self._before):
            self._before.setFocus()

    def _arrange_in(self, columns: int) -> None:
        if columns == self._columns:
            return
        self._columns = columns
        self._content = content = QWidget()
        grid = QGridLayout(content)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setHorizontalSpacing(_BETWEEN_COLUMNS_PX)
        grid.setVerticalSpacing(_BETWEEN_ROWS_PX)
        rows = -(-len(self._keys) // columns)
        for number, key in enumerate(self._keys):
            column, row = divmod(number, rows)
            name = PlainLabel(key.shown)
            set_bold(name, True)
            grid.addWidget(name, row, 2 * column, Qt.AlignmentFlag.AlignTop)
            grid.addWidget(PlainLabel(key.does), row, 2 * column + 1)
        self.area.setWidget(content)
        content.show()

    def _natural_size(self) -> QSize:
        """Returns the size in which nothing scrolls, with room for a scroll bar all the same."""
        left, above, right, below = _MARGINS
        frame_px = 2 * self.frameWidth()
        around = QSize(
            left + right + frame_px + self.area.verticalScrollBar().sizeHint().width(),
            above + below + frame_px + self._title.sizeHint().height() + _SPACING_PX,
        )
        return self._content.sizeHint() + around
