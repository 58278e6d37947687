"""Round gauge in a corner of the picture: speed, or turn rate."""

import math
from typing import Final

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPen

from console.monitor.motion import Reading
from console.presentation.formatting import signed
from console.window.overlay import Overlay

GROUND: Final = QColor(16, 18, 20, 170)
"""Behind what is painted over the picture: the scene stays visible, and white text readable."""
INK: Final = QColor("#FFFFFF")
DIM_INK: Final = QColor("#C8CCD0")
TRACK: Final = QColor(255, 255, 255, 60)
VALUE: Final = QColor("#56B4E9")
_STALE: Final = QColor("#E69F00")
_START_DEG: Final = 225
_SPAN_DEG: Final = 270
_MIDDLE_DEG: Final = 90


class Gauge(Overlay):
    """An arc with the value in its middle. A value with a direction starts at the top, left is positive.

    Args:
        title: what is measured.
        unit: of the value.
        directed: whether the value has a direction.
    """

    def __init__(self, title: str, unit: str, *, directed: bool = False) -> None:
        super().__init__()
        self._title, self._unit, self._directed = title, unit, directed
        self._reading = Reading(0.0, 1.0)
        self._stale = False

    @property
    def value_text(self) -> str:
        """The value as it is shown."""
        value = self._reading.value
        return signed(value) if self._directed else f"{value:.2f}"

    def show_reading(self, reading: Reading, *, stale: bool) -> None:
        """Shows the latest value."""
        if (reading, stale) != (self._reading, self._stale):
            self._reading, self._stale = reading, stale
            self.redraw()
        state = ", stale" if stale else ""
        self.setAccessibleName(f"{self._title}: {self.value_text} {self._unit}{state}")

    def draw(self, painter: QPainter) -> None:
        """Draws arc, value and unit."""
        side = float(min(self.width(), self.height()))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(GROUND)
        painter.drawEllipse(QRectF(0, 0, side, side))
        thick = side / 14
        ring = QRectF(0, 0, side, side).adjusted(thick, thick, -thick, -thick)
        self._paint_arc(painter, ring, thick)
        self._paint_texts(painter, side)

    def _paint_arc(self, painter: QPainter, ring: QRectF, thick: float) -> None:
        def arc(colour: QColor, start_deg: float, span_deg: float) -> None:
            painter.setPen(QPen(colour, thick, Qt.PenStyle.SolidLine, Qt.PenCapStyle.FlatCap))
            painter.drawArc(ring, round(start_deg * 16), round(span_deg * 16))

        share = max(-1.0, min(1.0, self._reading.value / self._reading.top))
        arc(TRACK, _START_DEG, -_SPAN_DEG)
        colour = _STALE if self._stale else VALUE
        if self._directed:
            arc(colour, _MIDDLE_DEG, share * _SPAN_DEG / 2)
            self._paint_zero(painter, ring, thick)
        else:
            arc(colour, _START_DEG, -share * _SPAN_DEG)

    def _paint_zero(self, painter: QPainter, ring: QRectF, thick: float) -> None:
        top = QPointF(ring.center().x(), ring.top())
        painter.setPen(QPen(INK, 1.5))
        painter.drawLine(top - QPointF(0, thick / 2), top + QPointF(0, thick))

    def _paint_texts(self, painter: QPainter, side: float) -> None:
        centre = QRectF(0, side * 0.28, side, side * 0.28)
        self._write(painter, centre, self.value_text, side * 0.21, _STALE if self._stale else INK, bold=True)
        self._write(painter, QRectF(0, side * 0.54, side, side * 0.16), self._unit, side * 0.12, DIM_INK)
        word = "STALE" if self._stale else f"max {self._reading.top:g}"
        below = QRectF(0, side * 0.74, side, side * 0.14)
        self._write(painter, below, word, side * 0.10, _STALE if self._stale else DIM_INK)

    def _write(
        self, painter: QPainter, box: QRectF, text: str, size_px: float, colour: QColor, *, bold: bool = False
    ) -> None:
        font = QFont(self.font())
        font.setPixelSize(max(8, math.floor(size_px)))
        font.setBold(bold)
        painter.setFont(font)
        painter.setPen(colour)
        painter.drawText(box, Qt.AlignmentFlag.AlignCenter, text)
