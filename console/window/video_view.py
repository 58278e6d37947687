"""Widget of the video: the latest frame, boxes around detections, and a banner while it is not live."""

from collections.abc import Callable
from typing import Final

from PySide6.QtCore import QRectF, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QColor, QImage, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from console.client.results import Detections
from console.receiver.frame import Frame
from console.viewer.formatting import Banner, banner
from console.viewer.geometry import Box, fitted
from console.viewer.overlay import marks
from console.viewer.playback import PlaybackState
from console.viewer.session import VideoSession
from console.window.handover import ThreadHandover
from console.window.video_paint import draw_banner, draw_marks

_TICK_MS: Final = 50
"""Period of checking for a frozen frame, and for a changed banner ("frozen for 1.2 s")."""
_USUAL_SIZE: Final = QSize(1280, 720)
_SMALLEST_SIZE: Final = QSize(320, 180)
_GROUND: Final = QColor("#101214")
_VEIL: Final = QColor(0, 0, 0, 115)
"""Over a frame that is not live: at a glance it differs from live video of a still scene."""


class VideoView(QWidget):
    """Shows one session's video. Only the latest frame is kept, and nothing here blocks.

    Frames are copied in the session's thread; the window's thread only paints.

    Args:
        session: source of frames (in BGRx); its owner starts and closes it.
        detections: returns the latest ones without waiting; the painting thread calls it.
    """

    painted = Signal()
    """A frame has just been painted for the first time."""

    def __init__(self, session: VideoSession, detections: Callable[[], Detections | None]) -> None:
        super().__init__()
        self._session = session
        self._detections = detections
        self.overlay_shown = True
        """Whether boxes are drawn."""
        self._ready: tuple[QImage, bytes] | None = None
        """The latest frame, and the memory of its pixels, which must live as long."""
        self._painted: tuple[QImage, bytes] | None = None
        self._banner: Banner | None = banner(session.playback())
        self._handover = ThreadHandover()
        self._handover.delivered.connect(self.update)
        session.add_frame_listener(self._make_ready)
        self._timer = QTimer(self, interval=_TICK_MS)
        self._timer.timeout.connect(self._check_banner)
        self._timer.start()
        # Every pixel is painted below: Qt need not clear the ground first.
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(_SMALLEST_SIZE)

    def sizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        """Returns the size of the usual frame."""
        return _USUAL_SIZE

    def show_overlay(self, shown: bool) -> None:
        """Shows or hides the boxes."""
        self.overlay_shown = shown
        self.update()

    def paintEvent(self, _event: QPaintEvent) -> None:  # noqa: N802 - Qt's name
        """Paints frame, boxes and banner."""
        playback = self._session.playback()
        live = playback.state is PlaybackState.LIVE
        # No frame is shown once the session has dropped its latest one.
        shown = self._ready if self._session.latest_frame() else None
        painter = QPainter(self)
        if shown is None:
            painter.fillRect(self.rect(), _GROUND)
        else:
            image, _ = shown
            box = fitted(image.width(), image.height(), Box(0, 0, self.width(), self.height()))
            self._draw_frame(painter, image, box, live)
            if self.overlay_shown and live:
                draw_marks(painter, marks(self._detections(), box))
        if text := banner(playback):
            draw_banner(painter, QRectF(self.rect()), text, over_frame=shown is not None)
        painter.end()
        if shown is not self._painted:
            self._painted = shown
            self.painted.emit()

    def _draw_frame(self, painter: QPainter, image: QImage, box: Box, live: bool) -> None:
        target = QRectF(box.x, box.y, box.width, box.height)
        if not target.contains(QRectF(self.rect())):
            painter.fillRect(self.rect(), _GROUND)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        painter.drawImage(target, image)
        if not live:
            painter.fillRect(target, _VEIL)

    def _check_banner(self) -> None:
        """Repaints when time alone has changed the banner: the frame gets older."""
        now = banner(self._session.playback())
        if now != self._banner:
            self._banner = now
            self.update()

    def _make_ready(self, frame: Frame) -> None:
        """Copies a new frame and hands it over. In the session's thread."""
        memory = frame.read()
        image = QImage(memory, frame.width, frame.height, frame.stride, QImage.Format.Format_RGB32)
        self._ready = (image, memory)
        self._handover.post()
