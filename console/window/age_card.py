"""Card with the age of the picture, in the upper right corner of the video: figures and a plot."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPen, QPixmap

from console.presentation.value_style import PICTURE_AGE_MS
from console.viewer.picture_meter import PictureMeter
from console.viewer.picture_reading import PictureReading
from console.window.theme import COLOURS

_PAPER: Final = QColor(16, 18, 20, 225)
_INK: Final = QColor("#FFFFFF")
_DIM_INK: Final = QColor("#C8CCD0")
_QUIET: Final = QColor("#8A9099")
_UNKNOWN_AGE: Final = "age not known"
_PAD: Final = 4.0
_STRIPE: Final = 5.0
_GAP: Final = 6.0
_PLOT_WIDTH: Final = 150.0
_PLOT_HEIGHT: Final = 36.0
_REFRESHES: Final = 5
"""Calls of `refresh` from one reading to the next."""


class AgeCard:
    """Draws the card once for each reading, because it is painted over every frame.

    Args:
        meter: measures the age.
    """

    def __init__(self, meter: PictureMeter) -> None:
        self._meter = meter
        self._calls = 0
        self._reading = PictureReading()
        self._drawn: QPixmap | None = None

    def refresh(self) -> bool:
        """Takes a reading now and then; returns whether it differs. Faster figures can't be read."""
        self._calls = (self._calls + 1) % _REFRESHES
        if self._calls:
            return False
        now = self._meter.reading()
        changed = now != self._reading
        if changed:
            self._reading, self._drawn = now, None
        return changed

    def paint(self, painter: QPainter, whole: QRectF) -> None:
        """Paints the card, if the age is known, or round trip and loss are."""
        if not (self._reading.age_text or self._reading.link_text):
            return
        ratio = painter.device().devicePixelRatioF()
        if self._drawn is None or self._drawn.devicePixelRatioF() != ratio:
            self._drawn = _drawn(self._reading, self._meter.history(), painter.font(), ratio)
        size = self._drawn.deviceIndependentSize()
        painter.drawPixmap(QPointF(whole.right() - size.width() - _GAP, whole.top() + _GAP), self._drawn)


def _drawn(now: PictureReading, history: Sequence[float | None], font: QFont, ratio: float) -> QPixmap:
    bold = QFont(font)
    bold.setBold(True)
    metrics = QFontMetricsF(bold)
    line = metrics.height()
    texts = (now.age_text or _UNKNOWN_AGE, now.link_text)
    width = max(_PLOT_WIDTH, *(metrics.horizontalAdvance(text) for text in texts)) + 2 * _PAD + _STRIPE
    card = QRectF(0, 0, width, 2 * line + _PLOT_HEIGHT + 3 * _PAD)
    drawn = QPixmap((card.size() * ratio).toSize())
    drawn.setDevicePixelRatio(ratio)
    drawn.fill(_PAPER)
    painter = QPainter(drawn)
    colour = COLOURS.get(now.style, _QUIET)
    painter.fillRect(QRectF(0, 0, _STRIPE, card.height()), colour)
    room = card.adjusted(_STRIPE + _PAD, _PAD, -_PAD, -_PAD)
    for used, ink, text in zip((bold, font), (_INK, _DIM_INK), texts, strict=True):
        painter.setFont(used)
        painter.setPen(ink)
        painter.drawText(room, int(Qt.AlignmentFlag.AlignTop), text)
        room.setTop(room.top() + line)
    room.setTop(room.top() + _PAD)
    _draw_curve(painter, room, history, colour)
    painter.end()
    return drawn


def _draw_curve(painter: QPainter, box: QRectF, history: Sequence[float | None], colour: QColor) -> None:
    """Draws ages from 0 to at least twice the limit, which is a line; an unknown one is a gap."""
    top = max(2 * PICTURE_AGE_MS.warning, *(age_ms for age_ms in history if age_ms is not None), 0.0)
    limit = box.bottom() - PICTURE_AGE_MS.warning / top * box.height()
    painter.setPen(QPen(_QUIET, 1, Qt.PenStyle.DotLine))
    painter.drawLine(QPointF(box.left(), limit), QPointF(box.right(), limit))
    painter.setPen(QPen(colour, 1.5))
    step = box.width() / max(1, len(history) - 1)
    before: QPointF | None = None
    for slot, age_ms in enumerate(history):
        point = None
        if age_ms is not None:
            point = QPointF(box.left() + slot * step, box.bottom() - age_ms / top * box.height())
            painter.drawLine(before or point, point)
        before = point
