"""Small plots of the last two minutes of each metric."""

from collections.abc import Iterator, Sequence

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QFont, QFontMetricsF, QPainter, QPaintEvent, QPalette, QPen, QPolygonF
from PySide6.QtWidgets import QBoxLayout, QSizePolicy, QWidget

from console.monitor.history import METRICS, SLOTS, History, Metric, top_of_scale
from console.presentation.formatting import bit_rate
from console.window.labels import set_tool_tip
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
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        set_tool_tip(self, f"{metric.title} in {metric.unit}: the last two minutes")

    @property
    def value_text(self) -> str:
        """The latest value, with its unit."""
        newest = self._series[-1] if self._series else None
        return NO_DATA if newest is None else self._with_unit(newest, self._metric.digits)

    @property
    def top_text(self) -> str:
        """The upper end of the scale."""
        top = top_of_scale(self._metric, self._series)
        return f"max {self._with_unit(top, 0)}" if top >= 1 else f"max {top:g} {self._metric.unit}"

    def show_series(self, series: list[float | None]) -> None:
        """Shows these values, the newest last."""
        if series != self._series:
            self._series = series
            self.setAccessibleName(f"{self._metric.title}: {self.value_text}")
            self.update()

    def _with_unit(self, value: float, digits: int) -> str:
        kilobits = self._metric.unit == "kbit/s"
        return bit_rate(value) if kilobits else f"{value:.{digits}f} {self._metric.unit}"

    def sizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        """Returns a size that lets five stand side by side."""
        line = self.fontMetrics().height()
        return QSize(10 * line, 6 * line)

    def minimumSizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        """Returns a size for title and value below each other, and a low curve."""
        line = self.fontMetrics().height()
        return QSize(7 * line, 3 * line)

    def paintEvent(self, _event: QPaintEvent) -> None:  # noqa: N802 - Qt's name
        """Paints title, value and curve."""
        painter = QPainter(self)
        palette = self.palette()
        painter.fillRect(self.rect(), palette.color(QPalette.ColorRole.Base))
        painter.setFont(self._font())
        line = painter.fontMetrics().height()
        inner = QRectF(self.rect()).adjusted(_MARGIN, _MARGIN - 2, -_MARGIN, -_MARGIN)
        texts = self.texts(inner.width())
        for row, (left, right) in enumerate(texts):
            box = inner.adjusted(0, row * line, 0, 0)
            painter.setPen(dim_text(palette))
            painter.drawText(box, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignTop, right)
            if row:
                painter.setFont(self._font(bold=True))
                painter.setPen(palette.color(QPalette.ColorRole.WindowText))
            painter.drawText(box, Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop, left)
        self._paint_curve(painter, inner.adjusted(0, len(texts) * line + 4, 0, 0), palette)

    def texts(self, width: float) -> tuple[tuple[str, str], tuple[str, str]]:
        """Returns the left and the right text of both lines: no two of them touch, the value is never cut."""
        title = QFontMetricsF(self._font())
        value = QFontMetricsF(self._font(bold=True))
        room = width - value.horizontalAdvance(self.value_text) - _MARGIN
        top = self.top_text if title.horizontalAdvance(self.top_text) <= room else ""
        shown = title.elidedText(self._metric.title, Qt.TextElideMode.ElideRight, width)
        return (shown, ""), (self.value_text, top)

    def _font(self, *, bold: bool = False) -> QFont:
        font = QFont(self.font())
        font.setPointSizeF(font.pointSizeF() * _SMALL)
        font.setBold(bold)
        return font

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
    """All plots, beside or below each other.

    Args:
        direction: of the row or column.
    """

    def __init__(self, direction: QBoxLayout.Direction) -> None:
        super().__init__()
        self.all: Sequence[Plot] = [Plot(metric) for metric in METRICS]
        fill(QBoxLayout(direction, self), *self.all, spacing=6)
        self.setAccessibleName("Plots of the last two minutes")

    def show_history(self, history: History) -> None:
        """Shows the recorded values."""
        for index, plot in enumerate(self.all):
            plot.show_series(history.series(index))
