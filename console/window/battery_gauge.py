"""Small gauge of a battery's charge."""

from PySide6.QtCore import QRectF
from PySide6.QtGui import QPainter, QPaintEvent, QPalette, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from console.monitor.bar_items import BatteryItem
from console.window.theme import COLOURS, dim_text

_WIDTH_PX = 28
_HEIGHT_PX = 14
_POLE_PX = 3


class BatteryGauge(QWidget):
    """A battery that is filled by its charge, in the colour of its style; empty while that is unknown."""

    def __init__(self) -> None:
        super().__init__()
        self._item = BatteryItem("", "")
        self.setFixedSize(_WIDTH_PX, _HEIGHT_PX)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)

    def show_item(self, item: BatteryItem) -> None:
        """Shows the latest charge."""
        if item != self._item:
            self._item = item
            self.update()

    def paintEvent(self, _event: QPaintEvent) -> None:  # noqa: N802 - Qt's name
        """Paints outline and charge."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        dim = dim_text(self.palette())
        body = QRectF(0.5, 0.5, self.width() - _POLE_PX - 1, self.height() - 1)
        painter.setPen(QPen(dim, 1))
        painter.drawRoundedRect(body, 2, 2)
        painter.fillRect(QRectF(body.right() + 0.5, self.height() / 2 - 3, _POLE_PX, 6), dim)
        if self._item.charge_percent is not None:
            inner = body.adjusted(2, 2, -2, -2)
            inner.setWidth(inner.width() * min(1.0, max(0.0, self._item.charge_percent / 100)))
            text = self.palette().color(QPalette.ColorRole.WindowText)
            painter.fillRect(inner, COLOURS.get(self._item.style, text))
