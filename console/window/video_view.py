"""Widget of the video: the latest frame, boxes around detections, and a banner while it is not live."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from PySide6.QtCore import QRectF, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QColor, QImage, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from console.client.results import Detections
from console.receiver.frame import Frame
from console.viewer.formatting import Banner, banner
from console.viewer.geometry import Box, fitted
from console.viewer.overlay import marks
from console.viewer.picture_meter import PictureMeter
from console.viewer.playback import Playback, PlaybackState
from console.viewer.session import VideoSession
from console.window.age_card import AgeCard
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
        meter: measures the age of the pictures, which is then shown over the video; None shows none.
    """

    painted = Signal()
    """A frame has just been painted for the first time."""
    reshaped = Signal()
    """The frame has another shape now, or there is none any more."""

    def __init__(
        self,
        session: VideoSession,
        detections: Callable[[], Detections | None],
        meter: PictureMeter | None = None,
    ) -> None:
        super().__init__()
        self._session = session
        self._detections = detections
        self._meter = meter
        self.overlay_shown = True
        """Whether boxes are drawn."""
        self.age_shown = True
        """Whether the age of the picture is drawn."""
        self._age = AgeCard(meter) if meter else None
        self._ready: tuple[QImage, bytes, Frame] | None = None
        """The latest frame as an image, and the memory of its pixels, which must live as long."""
        self._painted: tuple[QImage, bytes, Frame] | None = None
        self._measured: Frame | None = None
        """The frame whose age was noted; None while none can be seen."""
        self._banner: Banner | None = banner(session.playback())
        self._shape = (0, 0)
        self._clear_px = (0, 0)
        self._handover = ThreadHandover(self)
        self._handover.delivered.connect(self.update)
        session.add_frame_listener(self._make_ready)
        self._timer = QTimer(self, interval=_TICK_MS)
        self._timer.timeout.connect(self._check_banner)
        self._timer.timeout.connect(self._check_age)
        self._timer.start()
        # Every pixel is painted below: Qt need not clear the ground first.
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(_SMALLEST_SIZE)
        self.setAccessibleName("Live video")

    def sizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        """Returns the size of the usual frame."""
        return _USUAL_SIZE

    def show_overlay(self, shown: bool) -> None:
        """Shows or hides the boxes."""
        self.overlay_shown = shown
        self.update()

    def playback(self) -> Playback:
        """Returns the state of the video at this moment."""
        return self._session.playback()

    @property
    def shape(self) -> float:
        """Width of the frame by its height; of the usual frame while there is none."""
        width, height = self._shape
        return width / height if height else _USUAL_SIZE.width() / _USUAL_SIZE.height()

    def keep_clear(self, beside_px: int, middle_px: int = 0) -> None:
        """Keeps the banner out of so much room at both sides, where other things lie over the picture.

        Args:
            beside_px: at the lower edge, where the banner lies over a frame.
            middle_px: in the middle, where it stands without a frame.
        """
        if (beside_px, middle_px) != self._clear_px:
            self._clear_px = beside_px, middle_px
            self.update()

    def frame_box(self) -> Box:
        """Returns where the frame is shown; without one the whole widget."""
        whole = Box(0, 0, self.width(), self.height())
        return fitted(*self._shape, whole) if all(self._shape) else whole

    def latest_image(self) -> QImage | None:
        """Returns a copy of the latest frame, without boxes; None when there is none to show."""
        shown = self._shown()
        return shown[0].copy() if shown else None

    def _shown(self) -> tuple[QImage, bytes, Frame] | None:
        """Returns what is shown: no frame once the session has dropped its latest one."""
        return self._ready if self._session.latest_frame() else None

    def show_age(self, shown: bool) -> None:
        """Shows or hides the age of the picture."""
        self.age_shown = shown
        self.update()

    def paintEvent(self, _event: QPaintEvent) -> None:  # noqa: N802 - Qt's name
        """Paints frame, boxes, the age and the banner."""
        playback = self._session.playback()
        live = playback.state is PlaybackState.LIVE
        shown = self._shown()
        painter = QPainter(self)
        if shown is None:
            painter.fillRect(self.rect(), _GROUND)
        else:
            image = shown[0]
            box = fitted(image.width(), image.height(), Box(0, 0, self.width(), self.height()))
            self._draw_frame(painter, image, box, live)
            if self.overlay_shown and live:
                draw_marks(painter, marks(self._detections(), box), box)
            if self.age_shown and self._age:
                self._age.paint(painter, QRectF(self.rect()))
        if text := banner(playback):
            clear = self._clear_px[0 if shown else 1]
            room = QRectF(self.rect()).adjusted(clear, 0, -clear, 0)
            draw_banner(painter, room, text, over_frame=shown is not None)
        painter.end()
        self._measure(shown[2] if shown else None)
        if shown is not self._painted:
            self._painted = shown
            self._note_shape(shown[0] if shown else None)
            self.painted.emit()

    def _draw_frame(self, painter: QPainter, image: QImage, box: Box, live: bool) -> None:
        target = QRectF(box.x, box.y, box.width, box.height)
        if not target.contains(QRectF(self.rect())):
            painter.fillRect(self.rect(), _GROUND)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        painter.drawImage(target, image)
        if not live:
            painter.fillRect(target, _VEIL)

    def _measure(self, frame: Frame | None) -> None:
        """Notes the age of a frame that has just been painted, where it can be seen."""
        if self._meter and frame and frame is not self._measured and self._can_be_seen():
            self._measured = frame
            self._meter.shown(frame)

    def _can_be_seen(self) -> bool:
        """Whether anything of the widget is on a screen: not while its window is minimised or hidden.

        A window system need not report that a window is covered by others.
        """
        window = self.window()
        handle = window.windowHandle()
        return self.isVisible() and not window.isMinimized() and handle is not None and handle.isExposed()

    def _note_shape(self, image: QImage | None) -> None:
        shape = (image.width(), image.height()) if image else (0, 0)
        if shape != self._shape:
            self._shape = shape
            self.reshaped.emit()

    def _check_banner(self) -> None:
        """Repaints when time alone has changed the banner: the frame gets older."""
        now = banner(self._session.playback())
        if now != self._banner:
            self._banner = now
            self.update()

    def _check_age(self) -> None:
        """Repaints when the age has changed: it grows while no frame comes."""
        if self._meter and not self._can_be_seen():
            # Qt paints no hidden window. An age that only grows would lower the bit rate of all viewers.
            self._measured = None
            self._meter.forget()
        if self._age and self._age.refresh():
            self.update()

    def _make_ready(self, frame: Frame) -> None:
        """Copies a new frame and hands it over. In the session's thread."""
        memory = frame.read()
        image = QImage(memory, frame.width, frame.height, frame.stride, QImage.Format.Format_RGB32)
        # The meter needs its times; its buffer belongs to the decoder's pool.
        self._ready = (image, memory, replace(frame, read=bytes))
        self._handover.post()
