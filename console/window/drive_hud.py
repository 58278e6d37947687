"""Head-up display of driving, in the upper left corner of the picture."""

from typing import Final

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPen

from console.presentation.drive_display import DriveDisplay, SpeedBar
from console.presentation.formatting import signed
from console.presentation.severity_style import SeverityStyle
from console.window.gauge import DIM_INK, INK, TRACK, VALUE
from console.window.overlay import Overlay
from console.window.theme import COLOURS

WIDTH_PX: Final = 272
_MARGIN_PX: Final = 9.0
_TEXT_PX: Final = 13
_BAR_PX: Final = 18.0
_BAR_LEFT_PX: Final = 62.0
_BAR_RIGHT_PX: Final = 96.0
DENSE_GROUND: Final = QColor(16, 18, 20, 215)
"""Darker than the gauges': there is more to read."""
_NOW: Final = QColor(255, 255, 255, 95)


class DriveHud(Overlay):
    """Who drives, the phase, why nothing moves, the speeds against their limits, the ages."""

    def __init__(self) -> None:
        super().__init__()
        self.shown: DriveDisplay | None = None
        """What is shown."""

    def show_display(self, display: DriveDisplay | None) -> None:
        """Shows the latest; None hides it."""
        if display == self.shown:
            return
        self.shown = display
        self.setVisible(display is not None)
        if display:
            texts = display.driver, display.phase, display.reason, display.ages
            self.setAccessibleName(". ".join(filter(None, texts)))
            self.resize(WIDTH_PX, round(self._height(display)))
        self.redraw()

    def draw(self, painter: QPainter) -> None:
        """Draws the lines, one below the other."""
        display = self.shown
        if display is None:
            return
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(DENSE_GROUND)
        painter.drawRoundedRect(QRectF(self.rect()), 6, 6)
        colour = COLOURS.get(display.style, INK)
        if display.style in (SeverityStyle.WARNING, SeverityStyle.BAD):
            painter.setBrush(colour)
            painter.drawRoundedRect(QRectF(0, 0, 5, self.height()), 2, 2)
        line_px, top = self._line_px(), _MARGIN_PX
        self._write(painter, self._row(top, line_px), display.driver, INK)
        self._write(
            painter, self._row(top, line_px), display.phase, INK, Qt.AlignmentFlag.AlignRight, bold=True
        )
        top += line_px
        if display.reason:
            height = self._reason_height(display.reason)
            ink = colour if display.style is SeverityStyle.WARNING else INK
            self._write(painter, self._row(top, height), display.reason, ink, Qt.TextFlag.TextWordWrap)
            top += height
        for bar in display.bars:
            self._draw_bar(painter, bar, top)
            top += _BAR_PX
        if display.ages:
            self._write(painter, self._row(top, line_px), display.ages, DIM_INK)

    def _draw_bar(self, painter: QPainter, bar: SpeedBar, top: float) -> None:
        """Draws what is permitted now, and the value from the middle, positive to the right."""
        box = QRectF(_BAR_LEFT_PX, top + 6, self.width() - _BAR_LEFT_PX - _BAR_RIGHT_PX, 6)
        half, middle = box.width() / 2, box.center().x()

        def share(value: float) -> float:
            return half * max(-1.0, min(1.0, value / bar.top)) if bar.top else 0.0

        painter.setPen(Qt.PenStyle.NoPen)
        painter.fillRect(box, TRACK)
        now = share(bar.now)
        painter.fillRect(QRectF(middle - now, box.top(), 2 * now, box.height()), _NOW)
        painter.fillRect(QRectF(middle, box.top(), share(bar.value), box.height()).normalized(), VALUE)
        painter.setPen(QPen(INK, 1))
        painter.drawLine(QPointF(middle, box.top() - 2), QPointF(middle, box.bottom() + 2))
        row = QRectF(_MARGIN_PX, top, self.width() - 2 * _MARGIN_PX, _BAR_PX)
        self._write(painter, row, bar.label, DIM_INK)
        self._write(painter, row, f"{signed(bar.value)} {bar.unit}", INK, Qt.AlignmentFlag.AlignRight)

    def _write(
        self,
        painter: QPainter,
        box: QRectF,
        text: str,
        colour: QColor,
        flags: Qt.AlignmentFlag | Qt.TextFlag = Qt.AlignmentFlag.AlignLeft,
        *,
        bold: bool = False,
    ) -> None:
        painter.setFont(self._font(bold=bold))
        painter.setPen(colour)
        painter.drawText(box, int(flags) | int(Qt.AlignmentFlag.AlignVCenter), text)

    def _row(self, top: float, height: float) -> QRectF:
        return QRectF(_MARGIN_PX, top, self.width() - 2 * _MARGIN_PX, height)

    def _height(self, display: DriveDisplay) -> float:
        lines = 1 + bool(display.ages)
        reason_px = self._reason_height(display.reason) if display.reason else 0.0
        return 2 * _MARGIN_PX + lines * self._line_px() + reason_px + len(display.bars) * _BAR_PX

    def _reason_height(self, reason: str) -> float:
        room = QRectF(0, 0, WIDTH_PX - 2 * _MARGIN_PX, 1000)
        found = QFontMetricsF(self._font()).boundingRect(room, int(Qt.TextFlag.TextWordWrap), reason)
        return found.height() + 4

    def _line_px(self) -> float:
        return QFontMetricsF(self._font()).height() + 3

    def _font(self, *, bold: bool = False) -> QFont:
        font = QFont(self.font())
        font.setPixelSize(_TEXT_PX)
        font.setBold(bold)
        return font
