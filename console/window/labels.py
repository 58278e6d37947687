"""Labels that are told the same thing ten times a second, and do nothing unless it has changed."""

from typing import Final

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QLabel, QSizePolicy

TOP: Final = Qt.AlignmentFlag.AlignTop
RIGHT: Final = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter


class WrappedLabel(QLabel):
    """Sentences from the robot: as many lines as they need; to be marked and copied, never markup."""

    def __init__(self) -> None:
        super().__init__()
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setWordWrap(True)
        self.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)

    def minimumSizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        """One line; how many more it takes, Qt asks when it knows the width."""
        return QSize(0, self.fontMetrics().height())


def word_label(text: str = "") -> QLabel:
    """For a word or a figure on one line."""
    label = QLabel(text)
    label.setTextFormat(Qt.TextFormat.PlainText)
    return label


class ElidedLabel(QLabel):
    """One line that gives way: what does not fit ends in dots, and is in the tool tip."""

    def __init__(self) -> None:
        super().__init__()
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)

    def setText(self, text: str) -> None:  # noqa: N802 - Qt's name
        """Changes the text."""
        super().setText(text)
        self.setToolTip(text)

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802 - Qt's name
        """Draws what fits."""
        painter = QPainter(self)
        fitting = self.fontMetrics().elidedText(self.text(), Qt.TextElideMode.ElideRight, self.width())
        painter.drawText(self.rect(), Qt.AlignmentFlag.AlignVCenter, fitting)


def width_of(text: str, *, bold: bool = False) -> int:
    """The width of a text in the desktop's font, in pixels."""
    label = word_label(text)
    set_bold(label, bold)
    return label.sizeHint().width()


def set_text(label: QLabel, text: str) -> None:
    """Changes a text; laying out the same one again would cost time."""
    if label.text() != text:
        label.setText(text)


def set_bold(label: QLabel, bold: bool) -> None:
    """Changes the weight."""
    font = label.font()
    if font.bold() != bold:
        font.setBold(bold)
        label.setFont(font)


def scale_font(label: QLabel, factor: float) -> None:
    """Changes the size against the desktop's."""
    font = label.font()
    font.setPointSizeF(font.pointSizeF() * factor)
    label.setFont(font)
