"""Lines of a window (component, fault, note), and a list of them. Updated in place, never made anew."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, Generic, TypeVar

from PySide6.QtCore import QEvent
from PySide6.QtGui import QPalette
from PySide6.QtWidgets import QFrame, QGridLayout, QVBoxLayout, QWidget

from console.monitor.status_rows import FaultLine
from console.presentation.preview_switch import Note
from console.presentation.severity_style import SeverityStyle
from console.presentation.status_table import Row
from console.window.labels import (
    RIGHT,
    TOP,
    PlainLabel,
    WrappedLabel,
    set_bold,
    set_text,
    set_tool_tip,
    width_of,
)
from console.window.theme import PALETTE_CHANGES, DimLabel, Marker, tinted_ground

_LONGEST_LABEL = "Computer battery"
_LONGEST_MARK = "no data"
_LONGEST_AGE = "59 min 00 s"
_LONGEST_SEVERITY = "warning"


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
        line: class of the lines.
    """

    def __init__(self, line: type[LineT]) -> None:
        super().__init__()
        self._line = line
        self._lines: list[LineT] = []
        self._shown = 0
        self._layout = QVBoxLayout(self)
        self._layout.setContentsMargins(0, 0, 0, 0)
        self._layout.setSpacing(2)

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


class ComponentLine(TintedLine):
    """A part of the robot: marker, name, mark, values, age."""

    def __init__(self) -> None:
        super().__init__()
        self.name, self.mark = PlainLabel(), PlainLabel()
        self.values, self.age = WrappedLabel(), DimLabel()
        self.name.setFixedWidth(width_of(_LONGEST_LABEL))
        self.mark.setFixedWidth(width_of(_LONGEST_MARK, bold=True))
        self.age.setFixedWidth(width_of(_LONGEST_AGE))
        self.age.setAlignment(RIGHT)
        for column, label in enumerate((self.name, self.mark), start=1):
            self.grid.addWidget(label, 0, column, TOP)
        self.grid.addWidget(self.values, 0, 3)
        self.grid.addWidget(self.age, 0, 4, TOP)
        self.grid.setColumnStretch(3, 1)

    def show_item(self, item: Row) -> None:
        """Shows one component."""
        self.show_style(item.style)
        set_text(self.name, item.label)
        set_text(self.mark, item.mark)
        set_bold(self.mark, item.style in (SeverityStyle.WARNING, SeverityStyle.BAD))
        set_text(self.values, item.text)
        set_text(self.age, item.age)
        self.setAccessibleName(f"{item.label}: {item.mark}. {item.text}. {item.age}")


class FaultWidget(TintedLine):
    """A fault: marker, severity, message, duration; below it the remedy."""

    def __init__(self) -> None:
        super().__init__()
        self.mark, self.message = PlainLabel(), WrappedLabel()
        self.remedy, self.since = WrappedLabel(), DimLabel()
        self.mark.setFixedWidth(width_of(_LONGEST_SEVERITY, bold=True))
        self.since.setAlignment(RIGHT)
        set_bold(self.mark, True)
        set_bold(self.message, True)
        self.grid.addWidget(self.mark, 0, 1, TOP)
        self.grid.addWidget(self.message, 0, 2)
        self.grid.addWidget(self.since, 0, 3, TOP)
        self.grid.addWidget(self.remedy, 1, 2, 1, 2)
        self.grid.setColumnStretch(2, 1)

    def show_item(self, item: FaultLine) -> None:
        """Shows one fault."""
        self.show_style(item.style)
        set_text(self.mark, item.mark)
        set_text(self.message, item.message)
        set_text(self.remedy, item.remedy)
        self.remedy.setVisible(bool(item.remedy))
        set_text(self.since, item.since)
        self.setAccessibleName(f"{item.mark}: {item.message}. {item.remedy}")


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
