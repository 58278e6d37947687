"""The picture: the newest one, boxes around what the robot sees, and words while it is not live."""

import time
from dataclasses import dataclass
from typing import Final

from PySide6.QtCore import QRectF, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QColor, QImage, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from console.receiver.frame import Frame
from console.viewer.banner import banner
from console.viewer.geometry import Box, fitted
from console.viewer.overlay import OverlaySource, marks
from console.viewer.session import VideoSession
from console.viewer.state import Phase, ViewState
from console.window.news import News
from console.window.video_paint import draw_banner, draw_marks

_TICK_MS: Final = 50
"""How soon a picture that stands still is noticed, and how often "frozen for 1.2 s" is looked at."""
_USUAL_SIZE: Final = QSize(1280, 720)
_SMALLEST_SIZE: Final = QSize(320, 180)
_GROUND: Final = QColor("#101214")
_VEIL: Final = QColor(0, 0, 0, 115)
"""Over a picture that is not live: at a glance it is another one than a live picture of a still scene."""


@dataclass(frozen=True, slots=True)
class Shown:
    """A picture as Qt paints it.

    Args:
        image: the picture; it lies in `memory`, which must live as long.
        memory: four bytes a pixel.
        frame: where it came from.
    """

    image: QImage
    memory: bytes
    frame: Frame


class VideoView(QWidget):
    """Shows one session's pictures. Only the newest one is kept, and nothing here waits for anybody.

    Pictures are made ready in the session's thread; the thread of the window only draws.

    Args:
        session: where pictures (in BGRx) and states come from. Whoever made it starts and closes it.
        overlay: gives the newest detections; None where nothing is to be drawn.
    """

    painted = Signal()
    """A picture, another one than before, has just been drawn."""

    def __init__(self, session: VideoSession, overlay: OverlaySource | None = None) -> None:
        super().__init__()
        self._session = session
        self._overlay = overlay
        self._overlay_shown = True
        self._ready: Shown | None = None
        self._drawn: Shown | None = None
        self._said = session.state()
        self._news = News()
        self._news.arrived.connect(self.update)
        session.watch_pictures(self.make_ready)
        self._ticks = QTimer(self, interval=_TICK_MS)
        self._ticks.timeout.connect(self._look)
        self._ticks.start()
        # Every pixel is painted below: Qt need not clear the ground first.
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(_SMALLEST_SIZE)

    def sizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        """As large as the usual picture."""
        return _USUAL_SIZE

    @property
    def overlay_shown(self) -> bool:
        """Whether boxes are drawn."""
        return self._overlay_shown

    @property
    def picture_box(self) -> Box | None:
        """Where the picture is shown, in pixels of this widget; None without a picture."""
        shown = self._shown()
        return fitted(shown.frame.width, shown.frame.height, self._whole()) if shown else None

    def show_overlay(self, shown: bool) -> None:
        """Draws the boxes, or leaves them out."""
        self._overlay_shown = shown
        self.update()

    def paintEvent(self, _event: QPaintEvent) -> None:  # noqa: N802 - Qt's name
        """Draws everything anew."""
        now_s, state = time.monotonic(), self._session.state()
        painter = QPainter(self)
        shown, box = self._shown(), self.picture_box
        if shown is None or box is None:
            painter.fillRect(self.rect(), _GROUND)
        else:
            self._draw_picture(painter, shown, box, state)
            if self._overlay and self._overlay_shown and state.phase is Phase.LIVE:
                draw_marks(painter, marks(self._overlay(), box, now_s))
        words = banner(state)
        if words:
            draw_banner(painter, QRectF(self.rect()), words, over_picture=shown is not None)
        painter.end()
        if shown is not self._drawn:
            self._drawn = shown
            self.painted.emit()

    def _draw_picture(self, painter: QPainter, shown: Shown, box: Box, state: ViewState) -> None:
        target = QRectF(box.x, box.y, box.width, box.height)
        if not target.contains(QRectF(self.rect())):
            painter.fillRect(self.rect(), _GROUND)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        painter.drawImage(target, shown.image)
        if state.phase is not Phase.LIVE:
            painter.fillRect(target, _VEIL)

    def _shown(self) -> Shown | None:
        """The newest picture, unless the session has none to show any more."""
        return self._ready if self._session.latest() else None

    def _whole(self) -> Box:
        return Box(0, 0, self.width(), self.height())

    def _look(self) -> None:
        """Time alone changes what is to be said: a picture gets old."""
        state = self._session.state()
        if banner(state) != banner(self._said):
            self._said = state
            self.update()

    def make_ready(self, frame: Frame) -> None:
        """Takes a new picture; called in the session's thread, where the copying is done."""
        memory = frame.plane(0)
        row_bytes = frame.planes[0].stride
        image = QImage(memory, frame.width, frame.height, row_bytes, QImage.Format.Format_RGB32)
        self._ready = Shown(image, memory, frame)
        self._news.tell()
