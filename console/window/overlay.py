"""Widget over the picture that is drawn when it changes, not with every frame below it."""

from abc import abstractmethod

from PySide6.QtCore import Qt
from PySide6.QtGui import QPainter, QPaintEvent, QPixmap, QResizeEvent
from PySide6.QtWidgets import QWidget


class Overlay(QWidget):
    """Keeps its drawing. The mouse goes through; hidden until it is shown."""

    def __init__(self) -> None:
        super().__init__()
        self._drawing: QPixmap | None = None
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setVisible(False)

    @abstractmethod
    def draw(self, painter: QPainter) -> None:
        """Draws what the widget shows, with antialiasing."""

    def redraw(self) -> None:
        """Draws anew: what the widget shows has changed."""
        self._drawing = None
        self.update()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802 - Qt's name
        """Draws anew in the new size."""
        super().resizeEvent(event)
        self._drawing = None

    def paintEvent(self, _event: QPaintEvent) -> None:  # noqa: N802 - Qt's name
        """Paints the drawing."""
        scale = self.devicePixelRatioF()
        if self._drawing is None or self._drawing.devicePixelRatioF() != scale:
            self._drawing = self._drawn(scale)
        QPainter(self).drawPixmap(0, 0, self._drawing)

    def _drawn(self, scale: float) -> QPixmap:
        pixmap = QPixmap(self.size() * scale)
        pixmap.setDevicePixelRatio(scale)
        pixmap.fill(Qt.GlobalColor.transparent)
        painter = QPainter(pixmap)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        self.draw(painter)
        painter.end()
        return pixmap
