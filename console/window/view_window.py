"""Window of `robotctl view`: the video, and one line below it."""

import time

from PySide6.QtCore import QEvent, Qt, QTimer
from PySide6.QtGui import QCloseEvent
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from console.viewer.formatting import delivery_text, figures_line, live_note, recording_line
from console.viewer.robot_video import RobotVideo
from console.window.keys import Key, bind_keys, full_screen_key, leave_full_screen
from console.window.labels import ElidedLabel, set_text
from console.window.layout import fill
from console.window.preview_actions import PreviewActions
from console.window.theme import DimLabel
from console.window.video_view import VideoView
from console.window.window_settings import DECORATION

_TICK_MS = 500
_KEYS = "P preview   V camera   O boxes   A age   F full screen   Q quit"


class ViewWindow(QWidget):
    """Shows one robot's stream.

    Args:
        robot: status and video.
        video: shows the video.
    """

    def __init__(self, robot: RobotVideo, video: VideoView) -> None:
        super().__init__()
        self.robot = robot
        self._actions = PreviewActions(self, robot.worker)
        self._counted = (time.monotonic(), 0)
        self.video = video
        self.figures, self.notes = ElidedLabel(), ElidedLabel()
        self._lay_out()
        # The frame's own size where there is room: Qt alone would take two thirds of the screen.
        self.resize(self.sizeHint().boundedTo(self.screen().availableSize() - DECORATION))
        self._timer = QTimer(self, interval=_TICK_MS)
        self._timer.timeout.connect(self._refresh)
        self._timer.start()
        keys = (
            Key(("P",), "preview on or off", self._actions.switch),
            Key(("V",), "next camera", self._actions.next_camera),
            Key(("O",), "boxes", lambda: self.video.show_overlay(not self.video.overlay_shown)),
            Key(("A",), "age of the picture", lambda: self.video.show_age(not self.video.age_shown)),
            Key(("Q",), "quit", self.close),
            full_screen_key(self, "F", "F11"),
            Key(("Esc",), "leave the full screen", lambda: leave_full_screen(self)),
        )
        bind_keys(self, keys)
        self.setWindowTitle(robot.worker.target)

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: N802 - Qt's name
        """Stops the timer."""
        self._timer.stop()
        super().closeEvent(event)

    def _lay_out(self) -> None:
        self._below = QWidget()
        keys = DimLabel(_KEYS)
        keys.setAlignment(Qt.AlignmentFlag.AlignRight)
        line = QHBoxLayout(self._below)
        fill(line, (self.figures, 2), (self.notes, 3), keys, spacing=16, margins=(8, 3, 8, 3))
        fill(QVBoxLayout(self), (self.video, 1), self._below, spacing=0)

    def _refresh(self) -> None:
        session, state = self.robot.session, self.robot.worker.latest()
        now_s, frames = time.monotonic(), session.frames
        before_s, before = self._counted
        self._counted = (now_s, frames)
        fps = (frames - before) / (now_s - before_s)
        set_text(self.figures, figures_line(session.latest_frame(), fps, session.redials))
        notes = [note.text for note in self._actions.controls(state, now_s).notes]
        texts = (recording_line(self.robot.recording), *notes, live_note(session.playback()))
        # Last: it is what may be elided in a small window.
        texts += (delivery_text(session.delivery()),)
        set_text(self.notes, "   ".join(filter(None, texts)))
        name = state.snapshot.status.gateway_name if state.snapshot else ""
        self.setWindowTitle(f"{name} {self.robot.worker.target}".strip())

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802 - Qt's name
        """Leaves the whole screen to the video."""
        super().changeEvent(event)
        if event.type() is QEvent.Type.WindowStateChange:
            self._below.setVisible(not self.isFullScreen())
