"""Lines of a window (row of the status, note), and a list of them. Updated in place, never made anew."""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar

from PySide6.QtCore import QEvent
from PySide6.QtGui import QPalette
from PySide6.QtWidgets import QFrame, QGridLayout, QHBoxLayout, QVBoxLayout, QWidget

from console.presentation.preview_switch import Note
from console.presentation.severity_style import SeverityStyle
from console.presentation.status_row import Row
from console.window.labels import (
    TOP,
    PlainLabel,
    WrappedLabel,
    set_bold,
    set_text,
    set_tool_tip,
)
from console.window.layout import fill
from console.window.theme import PALETTE_CHANGES, DimLabel, Marker, tinted_ground


class TintedLine(QFrame):
    """A line that shows one item. Its ground has the colour of the item's style, the marker its shape."""

    def __init__(self) -> None:
        super().__init__()
        self.marker = Marker()
        self.setAutoFillBackground(True)
        self.grid = QGridLayout(self)
        self.grid.setContentsMargins(6, 3, 6, 3)
        self.grid.setHorizontalSpacing(8)
        self.grid.setVerticalSpacing(1)
        self.grid.addWidget(self.marker, 0, 0, TOP)

    @abstractmethod
    def show_item(self, item: Any) -> None:
        """Shows an item of the line's own type."""

    def show_style(self, style: SeverityStyle, *, blank: bool = False) -> None:
        """Changes shape and ground; a blank shape keeps its place."""
        self.marker.show_style(style, blank=blank)
        self._colour_ground()

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802 - Qt's name
        """Follows the desktop from light to dark."""
        super().changeEvent(event)
        if event.type() in PALETTE_CHANGES:
            self._colour_ground()

    def _colour_ground(self) -> None:
        parent = self.parentWidget()
        ground = tinted_ground((parent or self).palette(), self.marker.severity)
        palette = self.palette()
        if palette.color(QPalette.ColorRole.Window) != ground:
            palette.setColor(QPalette.ColorRole.Window, ground)
            self.setPalette(palette)


LineT = TypeVar("LineT", bound=TintedLine)


class LineList(QWidget, Generic[LineT]):
    """Lines below each other. Surplus lines are hidden, and used again later.

    Args:
        line: makes a line.
    """

    def __init__(self, line: Callable[[], LineT]) -> None:
        super().__init__()
        self._line = line
        self._lines: list[LineT] = []
        self._shown = 0
        self._layout = fill(QVBoxLayout(self), spacing=2)

    @property
    def shown(self) -> Sequence[LineT]:
        """The visible lines."""
        return self._lines[: self._shown]

    def show_items(self, items: Sequence[Any]) -> None:
        """Shows exactly these items."""
        while len(self._lines) < len(items):
            self._lines.append(self._line())
            self._layout.addWidget(self._lines[-1])
        for line, item in zip(self._lines, items, strict=False):
            line.show_item(item)
        for number in range(min(self._shown, len(items)), max(self._shown, len(items))):
            self._lines[number].setVisible(number < len(items))
        self._shown = len(items)


class StatusLine(TintedLine):
    """A row of the status in a narrow panel: label, mark and age, and below them the text.

    The mark of a good row is not shown: its shape says so, and only what is not good deserves a word.
    """

    def __init__(self) -> None:
        super().__init__()
        self.label, self.mark, self.text, self.age = PlainLabel(), PlainLabel(), WrappedLabel(), DimLabel()
        head = fill(QHBoxLayout(), self.label, self.mark, spacing=8)
        head.addStretch(1)
        head.addWidget(self.age)
        self.grid.addLayout(head, 0, 1)
        self.grid.addWidget(self.text, 1, 1)
        self.grid.setColumnStretch(1, 1)

    def show_item(self, item: Row) -> None:
        """Shows one row."""
        self.show_style(item.style)
        set_text(self.label, item.label)
        set_text(self.mark, item.mark)
        self.mark.setHidden(item.style is SeverityStyle.GOOD)
        set_bold(self.mark, item.style in (SeverityStyle.WARNING, SeverityStyle.BAD))
        set_text(self.text, item.text)
        self.text.setVisible(bool(item.text))
        set_text(self.age, item.age)
        self.setAccessibleName(f"{item.label}: {item.mark}. {item.text}. {item.age}")


class NoteLine(TintedLine):
    """A note below the preview's controls: marker and text."""

    def __init__(self) -> None:
        super().__init__()
        self.text = WrappedLabel()
        self.grid.addWidget(self.text, 0, 1)
        self.grid.setColumnStretch(1, 1)

    def show_item(self, item: Note) -> None:
        """Shows one note."""
        self.show_style(item.style, blank=not item.text)
        set_text(self.text, item.text)
        set_tool_tip(self.text, item.text)
