"""A list of lines that grows and shrinks with its items."""

from collections.abc import Callable, Sequence
from typing import Generic, Protocol, TypeVar

from PySide6.QtWidgets import QVBoxLayout, QWidget

ItemT = TypeVar("ItemT")
ItemT_contra = TypeVar("ItemT_contra", contravariant=True)


class Line(Protocol[ItemT_contra]):
    """A widget that shows one item."""

    def show_item(self, item: ItemT_contra, /) -> None:
        """Shows it."""

    def setVisible(self, visible: bool, /) -> None:  # noqa: N802 - Qt's name
        """Qt's own."""


class LineList(QWidget, Generic[ItemT]):
    """Lines below each other. Those that are not needed now are hidden, and used again later.

    Args:
        make_line: makes a line; it must be a QWidget.
    """

    def __init__(self, make_line: Callable[[], Line[ItemT]]) -> None:
        super().__init__()
        self._make_line = make_line
        self._lines: list[Line[ItemT]] = []
        self._shown = 0
        self._layout = QVBoxLayout(self)
        self._layout.setContentsMargins(0, 0, 0, 0)
        self._layout.setSpacing(2)

    @property
    def shown(self) -> Sequence[Line[ItemT]]:
        """The lines that are to be seen."""
        return self._lines[: self._shown]

    def show_items(self, items: Sequence[ItemT]) -> None:
        """Shows these and no others."""
        while len(self._lines) < len(items):
            line = self._make_line()
            assert isinstance(line, QWidget)
            self._layout.addWidget(line)
            self._lines.append(line)
        for line, item in zip(self._lines, items, strict=False):
            line.show_item(item)
        for number in range(min(self._shown, len(items)), max(self._shown, len(items))):
            self._lines[number].setVisible(number < len(items))
        self._shown = len(items)
