"""The window of `robotctl view`: the picture, and one line below it."""

import time

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QCloseEvent, QKeySequence, QShortcut
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from console.monitor.preview_controls import controls
from console.monitor.worker import Worker
from console.receiver.recording import Recording
from console.viewer.session import VideoSession
from console.viewer.words import beside_the_picture, figures_line, recording_line
from console.window.labels import ElidedLabel, set_text, word_label
from console.window.look import DimLabel
from console.window.video_view import VideoView

_TICK_MS = 500
_KEYS = "P preview   O boxes   F full screen   Q quit"


class ViewWindow(QWidget):
    """Shows one robot's stream.

    Args:
        worker: talks to the gateway.
        session: receives the stream.
        video: shows it.
        recording: is kept beside; None when nothing is.
    """

    def __init__(
        self, worker: Worker, session: VideoSession, video: VideoView, recording: Recording | None
    ) -> None:
        super().__init__()
        self._worker = worker
        self._session = session
        self._recording = recording
        self._counted = (time.monotonic(), 0)
        self.video = video
        self.figures, self.said = word_label(), ElidedLabel()
        self._lay_out()
        # The picture in its own size, where there is room: Qt alone would take two thirds of the screen.
        self.resize(self.sizeHint().boundedTo(self.screen().availableSize()))
        self._ticks = QTimer(self, interval=_TICK_MS)
        self._ticks.timeout.connect(self._tick)
        self._ticks.start()
        for key, act in (
            ("P", self._switch),
            ("O", lambda: self.video.show_overlay(not self.video.overlay_shown)),
            ("F", self._toggle_full_screen),
            ("F11", self._toggle_full_screen),
            ("Esc", self._leave_full_screen),
            ("Q", self.close),
        ):
            QShortcut(QKeySequence(key), self, act)
        self.setWindowTitle(worker.target)

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: N802 - Qt's name
        """Nothing ticks any more."""
        self._ticks.stop()
        super().closeEvent(event)

    def _lay_out(self) -> None:
        self._below = QWidget()
        line = QHBoxLayout(self._below)
        line.setContentsMargins(8, 3, 8, 3)
        line.setSpacing(16)
        line.addWidget(self.figures)
        line.addWidget(self.said, 1)
        keys = DimLabel(_KEYS)
        keys.setAlignment(Qt.AlignmentFlag.AlignRight)
        line.addWidget(keys)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self.video, 1)
        column.addWidget(self._below)

    def _tick(self) -> None:
        now_s, pictures = time.monotonic(), self._session.figures().pictures
        before_s, before = self._counted
        self._counted = (now_s, pictures)
        fps = (pictures - before) / (now_s - before_s)
        set_text(self.figures, figures_line(self._session.latest(), fps, self._session.figures().redials))
        state = self._worker.newest()
        notes = [note.text for note in controls(state, None, now_s).notes]
        said = (recording_line(self._recording), *notes, beside_the_picture(self._session.state()))
        set_text(self.said, "   ".join(filter(None, said)))
        name = state.snapshot.status.gateway_name if state.snapshot else ""
        self.setWindowTitle(f"{name} {self._worker.target}".strip())

    def _switch(self) -> None:
        now = controls(self._worker.newest(), None, time.monotonic())
        if now.enabled:
            self._worker.switch(now.switched())

    def _toggle_full_screen(self) -> None:
        full = not self.isFullScreen()
        self._below.setVisible(not full)
        if full:
            self.showFullScreen()
        else:
            self.showNormal()

    def _leave_full_screen(self) -> None:
        if self.isFullScreen():
            self._toggle_full_screen()
