"""Fills the layouts of a window."""

from typing import TypeAlias, TypeVar

from PySide6.QtWidgets import QBoxLayout, QWidget

Part: TypeAlias = QWidget | QBoxLayout | int | tuple[QWidget, int]
"""A widget; a nested layout; a space in pixels; a widget and its share of the room that is left."""

LayoutT = TypeVar("LayoutT", bound=QBoxLayout)


def fill(
    layout: LayoutT, *parts: Part, spacing: int = -1, margins: tuple[int, int, int, int] = (0, 0, 0, 0)
) -> LayoutT:
    """Returns the layout with these parts. Spacing and margins are in pixels, -1 is the style's spacing."""
    layout.setContentsMargins(*margins)
    layout.setSpacing(spacing)
    for part in parts:
        match part:
            case QWidget():
                layout.addWidget(part)
            case QBoxLayout():
                layout.addLayout(part)
            case int():
                layout.addSpacing(part)
            case widget, share:
                layout.addWidget(widget, share)
    return layout
