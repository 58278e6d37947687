"""Paints the practice robot's pictures. Each says PRACTICE: a screenshot of one shows no robot's camera."""

from collections.abc import Sequence
from typing import Final, TypeAlias

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QImage, QPainter, QPen

_SKY: Final = QColor("#2b3138")
_CAPTION: Final = QColor(204, 121, 167, 150)
_CAPTION_SHARE: Final = 1 / 7


Line: TypeAlias = tuple[float, float, float, float, str, float]
"""Both ends in pixels, x right, y down; colour; width in pixels."""


def painted(lines: Sequence[Line], width_px: int, height_px: int) -> bytes:
    """Returns a picture of lines in BGRx. In any thread."""
    image = QImage(width_px, height_px, QImage.Format.Format_RGB32)
    image.fill(_SKY)
    painter = QPainter(image)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    for x1, y1, x2, y2, colour, thick_px in lines:
        painter.setPen(QPen(QColor(colour), thick_px))
        painter.drawLine(QPointF(x1, y1), QPointF(x2, y2))
    font = QFont()
    font.setBold(True)
    font.setPixelSize(round(height_px * _CAPTION_SHARE))
    painter.setFont(font)
    painter.setPen(_CAPTION)
    painter.drawText(QRectF(0, 0, width_px, height_px), Qt.AlignmentFlag.AlignCenter, "PRACTICE")
    painter.end()
    return bytes(image.constBits())
