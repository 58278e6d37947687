"""Small plots of the last two minutes of each metric."""

from collections.abc import Iterator, Sequence

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QPalette, QPen, QPolygonF
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QWidget

from console.monitor.history import METRICS, SLOTS, History, Metric, top_of_scale
from console.window.layout import fill
from console.window.theme import CURVE_ON_DARK, CURVE_ON_LIGHT, dim_text, is_dark, mixed

NO_DATA = "no data"
_MARGIN = 6
_FILL = 0.18
_SMALL = 0.85


class Plot(QWidget):
    """Title and latest value on top, the curve below; unknown values are a gap.

    Args:
        metric: title, unit and scale.
    """

    def __init__(self, metric: Metric) -> None:
        super().__init__()
        self._metric = metric
        self._series: list[float | None] = []
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setToolTip(f"{metric.title} in {metric.unit}: the last two minutes")

    @property
    def value_text(self) -> str:
        """The latest value, with its unit."""
        newest = self._series[-1] if self._series else None
        return NO_DATA if newest is None else f"{newest:.{self._metric.digits}f} {self._metric.unit}"

    def show_series(self, series: list[float | None]) -> None:
        """Shows these values, the newest last."""
        if series != self._series:
            self._series = series
            self.setAccessibleName(f"{self._metric.title}: {self.value_text}")
            self.update()

    def sizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        """Returns a size that lets five stand side by side."""
        line = self.fontMetrics().height()
        return QSize(10 * line, 6 * line)

    def minimumSizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        """Returns a size for title and value below each other."""
        line = self.fontMetrics().height()
        return QSize(7 * line, 6 * line)

    def paintEvent(self, _event: QPaintEvent) -> None:  # noqa: N802 - Qt's name
        """Paints title, value and curve."""
        painter = QPainter(self)
        palette = self.palette()
        painter.fillRect(self.rect(), palette.color(QPalette.ColorRole.Base))
        font = painter.font()
        font.setPointSizeF(font.pointSizeF() * _SMALL)
        painter.setFont(font)
        line = painter.fontMetrics().height()
        inner = QRectF(self.rect()).adjusted(_MARGIN, _MARGIN - 2, -_MARGIN, -_MARGIN)
        painter.setPen(dim_text(palette))
        painter.drawText(inner, Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop, self._metric.title)
        self._paint_value(painter, inner.adjusted(0, line, 0, 0), palette)
        self._paint_curve(painter, inner.adjusted(0, 2 * line + 4, 0, 0), palette)

    def _paint_value(self, painter: QPainter, box: QRectF, palette: QPalette) -> None:
        top = top_of_scale(self._metric, self._series)
        painter.drawText(box, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignTop, f"max {top:g}")
        font = painter.font()
        font.setBold(True)
        painter.setFont(font)
        painter.setPen(palette.color(QPalette.ColorRole.WindowText))
        painter.drawText(box, Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop, self.value_text)

    def _paint_curve(self, painter: QPainter, box: QRectF, palette: QPalette) -> None:
        colour = CURVE_ON_DARK if is_dark(palette) else CURVE_ON_LIGHT
        ground = palette.color(QPalette.ColorRole.Base)
        painter.setPen(QPen(mixed(ground, dim_text(palette), 0.5), 1))
        painter.drawLine(box.bottomLeft(), box.bottomRight())
        painter.drawLine(box.topLeft(), box.topRight())
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setBrush(mixed(ground, colour, _FILL))
        for points in self._pieces(box):
            ends = [QPointF(points[-1].x(), box.bottom()), QPointF(points[0].x(), box.bottom())]
            painter.setPen(Qt.PenStyle.NoPen)
            painter.drawPolygon(QPolygonF(points + ends))
            painter.setPen(QPen(colour, 1.5))
            if len(points) == 1:
                painter.drawPoint(points[0])
            else:
                painter.drawPolyline(QPolygonF(points))

    def _pieces(self, box: QRectF) -> Iterator[list[QPointF]]:
        """Yields the curve between its gaps, in the box's coordinates."""
        bottom = self._metric.bottom
        height = top_of_scale(self._metric, self._series) - bottom
        piece: list[QPointF] = []
        for slot, value in enumerate(self._series):
            if value is not None:
                share = min(1.0, max(0.0, (value - bottom) / height))
                x = box.left() + slot / (SLOTS - 1) * box.width()
                piece.append(QPointF(x, box.bottom() - share * box.height()))
            elif piece:
                yield piece
                piece = []
        if piece:
            yield piece


class Plots(QWidget):
    """All plots, side by side."""

    def __init__(self) -> None:
        super().__init__()
        self.all: Sequence[Plot] = [Plot(metric) for metric in METRICS]
        fill(QHBoxLayout(self), *self.all, spacing=6)

    def show_history(self, history: History) -> None:
        """Shows the recorded values."""
        for index, plot in enumerate(self.all):
            plot.show_series(history.series(index))
