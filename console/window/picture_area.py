"""The picture, edge to edge, and what lies over it: driving, gauges, values, trail, recorder, messages."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import QEvent, QPoint, QRect, Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget

from console.monitor.bar_items import BarItem
from console.monitor.motion import Motion
from console.monitor.trail import Trail
from console.monitor.value_tiles import TileItem
from console.presentation.drive_display import DriveDisplay
from console.window.connection_banner import ConnectionBanner
from console.window.drive_hud import DriveHud
from console.window.gauge import Gauge
from console.window.key_help import KeyHelp
from console.window.keys import Key
from console.window.layout import fill
from console.window.record_tile import RecordTile
from console.window.theme import COCKPIT
from console.window.toasts import Toasts
from console.window.trail_view import TrailView
from console.window.value_tiles import ValueTiles
from console.window.video_view import VideoView

_EDGE_PX: Final = 8
_GAUGE_SHARE: Final = 1 / 6
_SMALLEST_GAUGE_PX: Final = 64
_LARGEST_GAUGE_PX: Final = 140
_WIDEST_MESSAGE_PX: Final = 560
_TILE_SHARE: Final = 1 / 6
_NARROWEST_TILE_PX: Final = 172
_WIDEST_TILE_PX: Final = 208
_MOST_TILE_SHARE: Final = 1 / 4


class PictureArea(QWidget):
    """Places everything by the picture itself, not by its letterbox.

    Args:
        video: the picture.
    """

    def __init__(self, video: VideoView) -> None:
        super().__init__()
        self.setPalette(COCKPIT)
        self.video, self.key_help = video, KeyHelp()
        self.banner, self.toasts = ConnectionBanner(), Toasts()
        self.speed = Gauge("Speed", "m/s")
        self.turn = Gauge("Turn rate, left is positive", "rad/s", directed=True)
        self.trail, self._trail_place = TrailView(), QRect()
        self.hud, self._corner = DriveHud(), QPoint()
        self.recorder = RecordTile()
        self.values, self._values_place = ValueTiles(), QRect()
        fill(QVBoxLayout(self), (video, 1))
        corners = (self.speed, self.turn, self.values, self.trail, self.hud, self.recorder)
        for overlay in (*corners, self.toasts, self.banner, self.key_help):
            overlay.setParent(self)
        # Not inside the paint event that found the new shape.
        video.reshaped.connect(self.place, Qt.ConnectionType.QueuedConnection)

    def show_keys(self, keys: Sequence[Key]) -> None:
        """Fills the list of keys, in this order."""
        self.key_help.fill(keys)

    def show_motion(self, motion: Motion | None, trail: Trail) -> None:
        """Shows the gauges, on a robot that has odometry, and its trail as soon as it has moved."""
        had_gauges = not self.speed.isHidden()
        self.speed.setVisible(motion is not None)
        self.turn.setVisible(motion is not None)
        if motion:
            self.speed.show_reading(motion.speed, stale=motion.stale)
            self.turn.show_reading(motion.turn, stale=motion.stale)
        self.trail.setVisible(trail.moved)
        self.trail.show_trail(trail)
        if had_gauges is not (motion is not None):
            self._place_messages()  # The tiles stand above a gauge, or in its place.

    def show_driving(self, display: DriveDisplay | None) -> None:
        """Shows the head-up display, on a robot that can be driven."""
        self.hud.show_display(display)
        self._place_messages()

    def show_recorder(self, item: BarItem | None) -> None:
        """Shows the recorder below the place of the trail, while there is something to show."""
        self.recorder.show_item(item)
        self._place_messages()

    def show_values(self, items: Sequence[TileItem]) -> None:
        """Shows the tiles of the values that the robot's configuration wants here."""
        were_hidden = self.values.isHidden()
        self.values.show_items(items)
        if self.values.isHidden() is not were_hidden:
            self._place_messages()

    def place(self) -> None:
        """Places everything anew."""
        box = self.video.frame_box()
        left, right = round(box.x) + _EDGE_PX, round(box.right) - _EDGE_PX
        top, bottom = round(box.y) + _EDGE_PX, round(box.bottom) - _EDGE_PX
        side = max(_SMALLEST_GAUGE_PX, min(_LARGEST_GAUGE_PX, round(box.height * _GAUGE_SHARE)))
        self.speed.setGeometry(left, bottom - side, side, side)
        self.turn.setGeometry(right - side, bottom - side, side, side)
        self._trail_place = QRect(right - side, top, side, side)
        self._corner = QPoint(left, top)
        width = max(_NARROWEST_TILE_PX, min(_WIDEST_TILE_PX, round(box.width * _TILE_SHARE)))
        self._values_place = QRect(left, top, min(width, round(box.width * _MOST_TILE_SHARE)), bottom - top)
        self._place_messages()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802 - Qt's name
        """Places everything in the new size."""
        super().resizeEvent(event)
        self.place()

    def event(self, event: QEvent) -> bool:
        """Places messages anew when one of them appears, or needs another height."""
        done = super().event(event)
        if event.type() is QEvent.Type.LayoutRequest:
            self._place_messages()
        return done

    def _place_messages(self) -> None:
        width = self.width()
        self.banner.setGeometry(0, 0, width, self.banner.heightForWidth(width))
        top = 0 if self.banner.isHidden() else self.banner.height()
        self.trail.setGeometry(self._trail_place)
        self.trail.move(self._trail_place.left(), max(self._trail_place.top(), top + _EDGE_PX))
        tile = self.recorder.sizeHint()
        right, below = self._trail_place.right() + 1, self.trail.geometry().bottom() + 1 + _EDGE_PX
        self.recorder.setGeometry(right - tile.width(), below, tile.width(), tile.height())
        self.hud.move(self._corner.x(), max(self._corner.y(), top + _EDGE_PX))
        self._place_values(top + _EDGE_PX)
        # Beside the head-up display and the tiles: an answer must not cover who drives, nor a value.
        shown = [part for part in (self.hud, self.values) if not part.isHidden()]
        left = max((part.geometry().right() for part in shown), default=0)
        room = min(_WIDEST_MESSAGE_PX, width - left - 2 * _EDGE_PX)
        height = self.toasts.height_for(room)
        middle = max((width - room) // 2, left + _EDGE_PX)
        self.toasts.setGeometry(middle, top + _EDGE_PX, room, min(height, self.height() // 2))
        self.key_help.fit(self.size())

    def _place_values(self, top: int) -> None:
        """Gives the tiles what is left between the head-up display and the gauge, and the banner the rest."""
        gauge, room = self.speed.geometry(), QRect(self._values_place)
        if not self.speed.isHidden():
            room.setBottom(gauge.top() - 1 - _EDGE_PX)
        room.setTop(max(room.top(), top))
        if not self.hud.isHidden():
            room.setTop(self.hud.geometry().bottom() + 1 + _EDGE_PX)
        self.values.setGeometry(room)
        column = 0 if self.values.isHidden() else room.right() + 1 + _EDGE_PX
        self.video.keep_clear(max(gauge.right() + 1 + _EDGE_PX, column), column)
