"""Paints over the video: boxes with labels, and a banner."""

import math
from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPen

from console.viewer.formatting import Banner
from console.viewer.geometry import Box, label_place
from console.viewer.overlay import Mark
from console.window.theme import COLOURS

_HALO: Final = QPen(QColor(0, 0, 0, 190), 5.0)
_LINE: Final = QPen(QColor("#F0E442"), 2.0)
"""Yellow of Okabe and Ito's palette in a dark halo: visible on any video, for colour-blind people, too."""
_LABEL_GROUND: Final = QColor(0, 0, 0, 190)
_LABEL_INK: Final = QColor("#F0E442")
_PAPER: Final = QColor(16, 18, 20, 225)
_INK: Final = QColor("#FFFFFF")
_DIM_INK: Final = QColor("#C8CCD0")
_QUIET: Final = QColor("#8A9099")
_PAD: Final = 4.0
_MARGIN: Final = 16.0
_WIDEST: Final = 640.0
_STRIPE: Final = 5.0
_GAP: Final = 6.0
_STEP: Final = 40.0
_TITLE_FACTOR: Final = 1.35


def draw_marks(painter: QPainter, marks: Sequence[Mark], frame: Box) -> None:
    """Draws all boxes, then all labels on top, within the frame."""
    painter.setBrush(Qt.BrushStyle.NoBrush)
    for pen in (_HALO, _LINE):
        painter.setPen(pen)
        for mark in marks:
            painter.drawRect(QRectF(mark.box.x, mark.box.y, mark.box.width, mark.box.height))
    for mark in marks:
        if mark.label:
            _draw_label(painter, mark, frame)


def draw_banner(painter: QPainter, whole: QRectF, text: Banner, *, over_frame: bool) -> None:
    """Draws a card: at the lower edge over a frame, so that it hides little; else in the middle."""
    title_font, font = QFont(painter.font()), QFont(painter.font())
    title_font.setBold(True)
    title_font.setPointSizeF(font.pointSizeF() * _TITLE_FACTOR)
    beside = 2 * _MARGIN + _STRIPE
    room = QRectF(0, 0, min(whole.width() - 2 * _MARGIN, _WIDEST) - beside, whole.height())
    title = _extent(title_font, room, text.title)
    detail = _extent(font, room, text.detail)
    # As wide as its text, in steps; the next second of "frozen for 9.9 s" does not change it.
    steps = math.ceil(max(title.width(), detail.width()) / _STEP + 0.25)
    room.setWidth(min(room.width(), steps * _STEP))
    width = room.width() + beside
    height = title.height() + (detail.height() + _GAP if text.detail else 0) + 2 * _MARGIN
    top = whole.bottom() - _MARGIN - height if over_frame else whole.center().y() - height / 2
    card = QRectF(whole.center().x() - width / 2, max(whole.top(), top), width, height)
    painter.fillRect(card, _PAPER)
    stripe = QRectF(card.left(), card.top(), _STRIPE, card.height())
    painter.fillRect(stripe, COLOURS.get(text.style, _QUIET))
    room.moveTo(card.left() + _STRIPE + _MARGIN, card.top() + _MARGIN)
    _write(painter, title_font, _INK, room, text.title)
    room.translate(0, title.height() + _GAP)
    _write(painter, font, _DIM_INK, room, text.detail)


def _extent(font: QFont, room: QRectF, text: str) -> QRectF:
    return QFontMetricsF(font).boundingRect(room, int(Qt.TextFlag.TextWordWrap), text)


def _write(painter: QPainter, font: QFont, colour: QColor, room: QRectF, text: str) -> None:
    painter.setFont(font)
    painter.setPen(colour)
    painter.drawText(room, int(Qt.TextFlag.TextWordWrap), text)


def _draw_label(painter: QPainter, mark: Mark, frame: Box) -> None:
    metrics = QFontMetricsF(painter.font())
    text = metrics.elidedText(mark.label, Qt.TextElideMode.ElideRight, frame.width - 2 * _PAD)
    size = metrics.horizontalAdvance(text) + 2 * _PAD, metrics.height() + _PAD
    place = label_place(mark.box, *size, frame)
    ground = QRectF(place.x, place.y, place.width, place.height)
    painter.fillRect(ground, _LABEL_GROUND)
    painter.setPen(_LABEL_INK)
    painter.drawText(QPointF(ground.left() + _PAD, ground.top() + _PAD / 2 + metrics.ascent()), text)
