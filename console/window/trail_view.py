"""The way the robot has driven, seen from above, in a corner of the picture."""

import math
from typing import Final

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPen, QPolygonF

from console.monitor.trail import Pose, Trail
from console.window.gauge import DIM_INK, GROUND, INK
from console.window.overlay import Overlay

_WAY: Final = QColor("#56B4E9")
_MARGIN_PX: Final = 12.0
_LEAST_SPAN_M: Final = 2.0
_SCALES_M: Final = (0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)


class TrailView(Overlay):
    """Up is where the robot looked when the way began. A dot is the beginning, the arrow the robot."""

    def __init__(self) -> None:
        super().__init__()
        self._points: tuple[Pose, ...] = ()

    def show_trail(self, trail: Trail) -> None:
        """Shows the latest way."""
        points = trail.points
        if len(points) != len(self._points) or points[-1] != self._points[-1]:
            self._points = points
            away_m = math.hypot(trail.pose.x_m, trail.pose.y_m)
            self.setAccessibleName(f"Way driven, from odometry: {away_m:.1f} m from its beginning")
            self.redraw()

    def draw(self, painter: QPainter) -> None:
        """Draws way, beginning, robot and scale."""
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(GROUND)
        painter.drawRoundedRect(QRectF(self.rect()), 6, 6)
        if not self._points:
            return
        pixels_per_m, middle = self._scale()

        def at(pose: Pose) -> QPointF:
            x = self.width() / 2 - (pose.y_m - middle.y_m) * pixels_per_m
            return QPointF(x, self.height() / 2 - (pose.x_m - middle.x_m) * pixels_per_m)

        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setPen(QPen(_WAY, 2))
        painter.drawPolyline(QPolygonF([at(pose) for pose in self._points]))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(DIM_INK)
        painter.drawEllipse(at(self._points[0]), 3, 3)
        self._paint_robot(painter, at(self._points[-1]), self._points[-1].heading_rad)
        self._paint_scale(painter, pixels_per_m)

    def _scale(self) -> tuple[float, Pose]:
        """Returns pixels per metre, and what is in the middle: the whole way fits."""
        xs, ys = [pose.x_m for pose in self._points], [pose.y_m for pose in self._points]
        span_m = max(max(xs) - min(xs), max(ys) - min(ys), _LEAST_SPAN_M)
        room_px = max(1.0, min(self.width(), self.height()) - 2 * _MARGIN_PX)
        return room_px / span_m, Pose((max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2)

    def _paint_robot(self, painter: QPainter, place: QPointF, heading_rad: float) -> None:
        painter.save()
        painter.translate(place)
        painter.rotate(-math.degrees(heading_rad))
        painter.setBrush(INK)
        painter.drawPolygon(QPolygonF([QPointF(0, -7), QPointF(5, 6), QPointF(0, 3), QPointF(-5, 6)]))
        painter.restore()

    def _paint_scale(self, painter: QPainter, pixels_per_m: float) -> None:
        longest_m = self.width() / 3 / pixels_per_m
        length_m = max((each for each in _SCALES_M if each <= longest_m), default=_SCALES_M[0])
        left, bottom = 8.0, self.height() - 6.0
        painter.setPen(QPen(DIM_INK, 1))
        painter.drawLine(QPointF(left, bottom), QPointF(left + length_m * pixels_per_m, bottom))
        font = QFont(self.font())
        font.setPixelSize(10)
        painter.setFont(font)
        painter.drawText(QPointF(left, bottom - 3), f"{length_m:g} m")
