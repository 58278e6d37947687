"""The list of recordings: a picture and three lines each, updated in place."""

from itertools import takewhile
from typing import Final

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QIcon, QImage, QPainter, QPixmap
from PySide6.QtWidgets import QListWidget, QListWidgetItem

from console.client import Recording
from console.monitor.recorder_controls import RecordingItem
from console.presentation.recording import is_written
from console.presentation.severity_style import SeverityStyle
from console.receiver.key_frame import HEIGHT_PX, PICTURE_BYTES, WIDTH_PX
from console.window.labels import plain_tip
from console.window.theme import draw_shape

_ID: Final = Qt.ItemDataRole.UserRole
_TILE: Final = QSize(80, 45)
_GROUND: Final = QColor("#3a4046")
_INK: Final = QColor("#c8ccd0")
_MARK: Final = QRectF(6, 6, 30, 30)
"""In the pixels of the picture, of which two are one of the tile."""
_LEAST_ROWS: Final = 3


class RecordingList(QListWidget):
    """Keeps the operator's choice and scroll position while recordings come and go."""

    def __init__(self) -> None:
        super().__init__()
        self._items: dict[str, RecordingItem] = {}
        self.setAccessibleName("Recordings on the robot")
        self.setIconSize(_TILE)
        self.setTextElideMode(Qt.TextElideMode.ElideRight)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setVerticalScrollMode(QListWidget.ScrollMode.ScrollPerPixel)
        self.setMinimumHeight(self.sizeHint().height())

    def sizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        """Returns the least that shows a list; it gets what else there is."""
        return QSize(_TILE.width(), _LEAST_ROWS * (_TILE.height() + 3))

    @property
    def chosen(self) -> RecordingItem | None:
        """The recording that the buttons are for."""
        item = self.currentItem()
        return self._items.get(item.data(_ID)) if item else None

    def show_items(self, items: tuple[RecordingItem, ...]) -> None:
        """Shows exactly these recordings, in this order."""
        kept = {each.recording.id for each in items}
        for row in reversed(range(self.count())):
            if self.item(row).data(_ID) not in kept:
                self.takeItem(row)
        for row, each in enumerate(items):
            self._show(row, each)
        self._items = {each.recording.id: each for each in items}
        if self.currentItem() is None and self.count():
            self.setCurrentRow(0)

    def visible(self) -> tuple[Recording, ...]:
        """Returns the recordings that can be seen, and whose picture can be had but is not there."""
        first, room = self.itemAt(1, 1), self.viewport().rect()
        rows = (self.item(row) for row in range(self.row(first) if first else 0, self.count()))
        seen = takewhile(lambda row: self.visualItemRect(row).intersects(room), rows)
        items = (self._items[each.data(_ID)] for each in seen)
        missing = (each.recording for each in items if each.picture is None)
        return tuple(recording for recording in missing if not is_written(recording))

    def _show(self, row: int, each: RecordingItem) -> None:
        item = self._item_at(row, each.recording.id)
        text = "\n".join(filter(None, (each.title, each.facts, each.state)))
        if item.text() != text:
            item.setText(text)
            item.setData(Qt.ItemDataRole.AccessibleTextRole, text.replace("\n", ", "))
            item.setToolTip(plain_tip(each.tip))
        before = self._items.get(each.recording.id)
        shown = (before.picture, before.style) if before else None
        if shown != (each.picture, each.style):
            item.setIcon(QIcon(self._tile(each)))

    def _item_at(self, row: int, recording_id: str) -> QListWidgetItem:
        """Returns the recording's item, which is in this row then.

        New ones come in front of the others; what is left behind them is moved when its turn comes.
        """
        for number in range(row, self.count()):
            item = self.item(number)
            if item.data(_ID) == recording_id:
                if number != row:
                    self.insertItem(row, self.takeItem(number))
                return item
        item = QListWidgetItem()
        item.setData(_ID, recording_id)
        self.insertItem(row, item)
        return item

    def _tile(self, each: RecordingItem) -> QPixmap:
        """Returns the picture, or a neutral tile, with the shape of the recording's state in its corner."""
        tile = QPixmap(WIDTH_PX, HEIGHT_PX)
        tile.fill(_GROUND)
        painter = QPainter(tile)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if each.picture and len(each.picture) == PICTURE_BYTES:
            image = QImage(each.picture, WIDTH_PX, HEIGHT_PX, 4 * WIDTH_PX, QImage.Format.Format_RGB32)
            painter.drawImage(0, 0, image)
        else:
            painter.setPen(_INK)
            font = painter.font()
            font.setPixelSize(HEIGHT_PX // 4)
            painter.setFont(font)
            words = "..." if each.picture is None else "no picture"
            painter.drawText(tile.rect(), Qt.AlignmentFlag.AlignCenter, words)
        if each.style in (SeverityStyle.WARNING, SeverityStyle.BAD):
            draw_shape(painter, _MARK, each.style, self.palette())
        painter.end()
        return tile
