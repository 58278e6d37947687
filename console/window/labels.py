"""Labels that are updated ten times a second, and lay out only changed texts."""

from html import escape
from typing import Final

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QAbstractButton, QLabel, QSizePolicy, QWidget

TOP: Final = Qt.AlignmentFlag.AlignTop
RIGHT: Final = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter


class PlainLabel(QLabel):
    """Plain text, never markup: the base of all labels that show a robot's texts."""

    def __init__(self, text: str = "") -> None:
        super().__init__(text)
        self.setTextFormat(Qt.TextFormat.PlainText)


class WrappedLabel(PlainLabel):
    """Sentences on as many lines as they need; selectable."""

    def __init__(self) -> None:
        super().__init__()
        self.setWordWrap(True)
        self.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)

    def minimumSizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        """Returns the size of one line; Qt asks for the height of all lines once it knows the width."""
        return QSize(0, self.fontMetrics().height())


class ElidedLabel(PlainLabel):
    """One line that is elided where there is little room; the tool tip has the whole text."""

    def __init__(self) -> None:
        super().__init__()
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)

    def setText(self, text: str) -> None:  # noqa: N802 - Qt's name
        """Changes the text and the tool tip."""
        super().setText(text)
        set_tool_tip(self, text)

    def paintEvent(self, _event: QPaintEvent) -> None:  # noqa: N802 - Qt's name
        """Draws the elided text."""
        paint_elided(self)


def paint_elided(label: QLabel) -> None:
    """Draws the text of a label on one line, elided where it does not fit. Within its paint event."""
    painter = QPainter(label)
    room = label.contentsRect()
    fitting = label.fontMetrics().elidedText(label.text(), Qt.TextElideMode.ElideRight, room.width())
    painter.drawText(room, Qt.AlignmentFlag.AlignVCenter, fitting)


def width_of(text: str, *, bold: bool = False) -> int:
    """Returns the width of a text in the desktop's font, in pixels."""
    label = PlainLabel(text)
    set_bold(label, bold)
    return label.sizeHint().width()


def set_text(label: QLabel | QAbstractButton, text: str) -> None:
    """Changes a text; laying out the same one again would cost time."""
    if label.text() != text:
        label.setText(text)


def set_tool_tip(widget: QWidget, text: str) -> None:
    """Changes a tool tip, as plain text."""
    widget.setToolTip(plain_tip(text))


def plain_tip(text: str) -> str:
    """Returns the tip that shows a text as it is: Qt itself takes one that looks like markup for markup."""
    return f"<span>{escape(text)}</span>" if text else ""


def set_bold(label: QLabel, bold: bool) -> None:
    """Changes the weight."""
    font = label.font()
    if font.bold() != bold:
        font.setBold(bold)
        label.setFont(font)


def scale_font(label: QLabel, factor: float) -> None:
    """Changes the size relative to the desktop's."""
    font = label.font()
    font.setPointSizeF(font.pointSizeF() * factor)
    label.setFont(font)
