"""Values of the robot's own choice over the picture, one tile above the other."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QResizeEvent
from PySide6.QtWidgets import QWidget

from console.monitor.value_tiles import MOST_TILES, TileItem, fitting
from console.window.drive_hud import DENSE_GROUND
from console.window.gauge import DIM_INK, INK
from console.window.overlay import Overlay
from console.window.theme import COCKPIT, COLOURS, draw_shape

TILE_PX: Final = 42
"""Height of a tile."""
_GAP_PX: Final = 4
_MARGIN_PX: Final = 9.0
_RIGHT_MARGIN_PX: Final = 7.0
_STRIPE_PX: Final = 5.0
_SMALL_PX: Final = 11
_VALUE_PX: Final = 16
_LONG_VALUE_PX: Final = 12
_SHAPE_PX: Final = 12.0
_SPACE_PX: Final = 5.0
_OLD_INK: Final = QColor("#A4A9B0")
"""Of a value that is not fresh: dim, and on this ground still with a contrast above 4.5."""


class ValueTile(Overlay):
    """Title and mark above, value and age below. Its size never depends on its texts."""

    def __init__(self) -> None:
        super().__init__()
        self.setPalette(COCKPIT)
        self.shown: TileItem | None = None
        """What is shown."""

    def show_item(self, item: TileItem | None) -> None:
        """Shows the latest item; None hides the tile."""
        if item == self.shown:
            return
        self.shown = item
        self.setVisible(item is not None)
        if item:
            self.setAccessibleName(item.spoken)
        self.redraw()

    def draw(self, painter: QPainter) -> None:
        """Draws ground, stripe and both lines."""
        item = self.shown
        if item is None:
            return
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(DENSE_GROUND)
        painter.drawRoundedRect(QRectF(self.rect()), 6, 6)
        if colour := COLOURS.get(item.style):
            painter.setBrush(colour)
            painter.drawRoundedRect(QRectF(0, 0, _STRIPE_PX, self.height()), 2, 2)
        room = QRectF(self.rect()).adjusted(_MARGIN_PX, 3, -_RIGHT_MARGIN_PX, -3)
        upper = QRectF(room.left(), room.top(), room.width(), room.height() * 0.42)
        lower = QRectF(room.left(), upper.bottom(), room.width(), room.bottom() - upper.bottom())
        # Mark and age stand at the right end: when they come, title and value stay where they are.
        upper.setRight(upper.right() - self._draw_mark(painter, upper, item))
        _write(painter, upper, item.title, self._font(_SMALL_PX), DIM_INK)
        taken = _write(painter, lower, item.age, self._font(_SMALL_PX), DIM_INK, at_right=True)
        lower.setRight(lower.right() - taken)
        font = self._font(_VALUE_PX, bold=True)
        if QFontMetricsF(font).horizontalAdvance(item.value) > lower.width():
            font = self._font(_LONG_VALUE_PX)
        _write(painter, lower, item.value, font, _OLD_INK if item.dim else INK)

    def _draw_mark(self, painter: QPainter, room: QRectF, item: TileItem) -> float:
        """Draws shape and word at the right end; returns the width that they take."""
        if not item.mark:
            return 0.0
        taken = _write(painter, room, item.mark, self._font(_SMALL_PX, bold=True), INK, at_right=True)
        left = room.right() - taken - _SHAPE_PX
        top = room.center().y() - _SHAPE_PX / 2
        draw_shape(painter, QRectF(left, top, _SHAPE_PX, _SHAPE_PX), item.style, self.palette())
        return room.right() - left + _SPACE_PX

    def _font(self, size_px: int, *, bold: bool = False) -> QFont:
        font = QFont(self.font())
        font.setPixelSize(size_px)
        font.setBold(bold)
        return font


class ValueTiles(QWidget):
    """Grows upwards from its lower edge: the first tile is the lowest, and none moves when others come."""

    def __init__(self) -> None:
        super().__init__()
        self.setAccessibleName("Values of this robot")
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.tiles = tuple(ValueTile() for _ in range(MOST_TILES))
        self._items: Sequence[TileItem] = ()
        for tile in self.tiles:
            tile.setParent(self)
        self.setVisible(False)

    def show_items(self, items: Sequence[TileItem]) -> None:
        """Shows the latest items, as many as there is room for."""
        self._items = items
        self.setVisible(bool(items))
        self._fill()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802 - Qt's name
        """Places the tiles in the new size."""
        super().resizeEvent(event)
        for place, tile in enumerate(self.tiles):
            tile.setGeometry(0, self._top(place), self.width(), TILE_PX)
        self._fill()

    def _fill(self) -> None:
        room = sum(self._top(place) >= 0 for place in range(MOST_TILES))
        shown: Sequence[TileItem | None] = fitting(self._items, room)
        for tile, item in zip(self.tiles, [*shown, *[None] * MOST_TILES], strict=False):
            tile.show_item(item)

    def _top(self, place: int) -> int:
        return self.height() - (place + 1) * TILE_PX - place * _GAP_PX


def _write(
    painter: QPainter, room: QRectF, text: str, font: QFont, ink: QColor, *, at_right: bool = False
) -> float:
    """Writes one line, elided where it does not fit; returns the width that it takes, with a space."""
    metrics = QFontMetricsF(font)
    fitting_text = metrics.elidedText(text, Qt.TextElideMode.ElideRight, room.width())
    side = Qt.AlignmentFlag.AlignRight if at_right else Qt.AlignmentFlag.AlignLeft
    painter.setFont(font)
    painter.setPen(ink)
    painter.drawText(room, int(side) | int(Qt.AlignmentFlag.AlignVCenter), fitting_text)
    return metrics.horizontalAdvance(fitting_text) + _SPACE_PX if text else 0.0
