"""Cell of the bar: a marker, a word in bold, and a smaller line below it."""

from typing import Final

from PySide6.QtGui import QPaintEvent
from PySide6.QtWidgets import QGridLayout, QSizePolicy, QWidget

from console.monitor.bar_items import BarItem
from console.presentation.formatting import joined
from console.window.labels import (
    PlainLabel,
    paint_elided,
    scale_font,
    set_bold,
    set_text,
    set_tool_tip,
    width_of,
)
from console.window.theme import DimLabel, Marker

SMALL: Final = 0.85


class SmallLabel(DimLabel):
    """Secondary text on one small line, elided where there is little room."""

    def __init__(self) -> None:
        super().__init__()
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        scale_font(self, SMALL)

    def paintEvent(self, _event: QPaintEvent) -> None:  # noqa: N802 - Qt's name
        """Draws the elided text."""
        paint_elided(self)


class Cell(QWidget):
    """Shows one item; as wide as its widest usual text, so that its neighbours stay in place.

    Args:
        title: what a screen reader calls it.
        widest: the widest usual word, and the widest usual detail.
        shape: shown before the word, for example a Marker; None for a word alone.
    """

    def __init__(self, title: str, widest: tuple[str, str], shape: QWidget | None) -> None:
        super().__init__()
        self._title = title
        self._shape = shape
        self.word, self.detail = PlainLabel(), SmallLabel()
        set_bold(self.word, True)
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 4, 0, 4)
        grid.setHorizontalSpacing(5)
        grid.setVerticalSpacing(0)
        if shape:
            grid.addWidget(shape, 0, 0)
        grid.addWidget(self.word, 0, 1 if shape else 0, 1, 1 if shape else 2)
        grid.addWidget(self.detail, 1, 0, 1, 2)
        grid.setColumnStretch(1, 1)
        word, detail = widest
        mark_px = shape.minimumWidth() + 5 if shape else 0
        room = max(width_of(word, bold=True) + mark_px, round(width_of(detail) * SMALL))
        self.setMinimumWidth(room)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)

    def show_item(self, item: BarItem) -> None:
        """Shows the latest item."""
        if isinstance(self._shape, Marker):
            self._shape.show_style(item.style)
        set_text(self.word, item.word)
        set_text(self.detail, item.detail)
        set_tool_tip(self, item.tip)
        self.setAccessibleName(f"{self._title}: {joined(item.word, item.detail)}")
