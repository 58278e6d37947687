"""The monitor window: one robot, all that an operator looks at."""

import time
from functools import partial
from typing import Protocol

from PySide6.QtCore import QSize, Qt, QTimer
from PySide6.QtGui import QCloseEvent, QShortcut
from PySide6.QtWidgets import QHBoxLayout, QSplitter, QVBoxLayout, QWidget

from console.client import PreviewProfile
from console.monitor.history import NOTHING, History, values_of
from console.monitor.link import link_words
from console.monitor.preview_controls import PROFILES, Controls, controls
from console.monitor.state import MonitorState, Wish
from console.window.header import Banner, Header
from console.window.news import News
from console.window.plot import Plots
from console.window.preview_panel import PreviewPanel
from console.window.remembered import Remembered
from console.window.side_panel import SidePanel
from console.window.video_view import VideoView

_TICK_MS = 500
_FIRST_SIZE = QSize(1280, 800)
_FRAME = QSize(16, 48)
"""What a desktop puts around a window, roughly."""
_HANDLE_PX = 10
_FIRST_DIVISION = (790, 490)


class Robot(Protocol):
    """Who talks to the gateway; `console.monitor.worker.Worker` does. Nothing here takes time."""

    target: str

    def newest(self) -> MonitorState:
        """What is known now."""

    def switch(self, wish: Wish) -> None:
        """Asks for a preview, or for none; the request is in the state at once."""

    def retry_now(self) -> None:
        """Ends the pause before the next attempt."""


class MonitorWindow(QWidget):
    """Shows the newest state whenever there is news, and twice a second besides: ages grow by themselves.

    Args:
        robot: who talks to the gateway.
        news: says when there is something new.
        video: the picture's widget.
        remembered: place and size.
    """

    def __init__(self, robot: Robot, news: News, video: VideoView, remembered: Remembered) -> None:
        super().__init__()
        self._robot = robot
        self._remembered = remembered
        self._history = History()
        self._marked: PreviewProfile | None = None
        self.video = video
        self.header, self.banner = Header(robot.target), Banner()
        self.preview, self.plots, self.side = PreviewPanel(), Plots(), SidePanel()
        self.splitter = QSplitter(Qt.Orientation.Horizontal)
        self._lay_out()
        self._connect(news)
        self.setWindowTitle(f"Robot {robot.target}")
        # No larger than a small laptop's screen leaves room for.
        self.resize(_FIRST_SIZE.boundedTo(self.screen().availableSize() - _FRAME))
        remembered.restore(self, self.splitter)
        self.refresh()

    def refresh(self) -> None:
        """Shows the newest state."""
        state, now_s = self._robot.newest(), time.monotonic()
        words = link_words(state.link, self._robot.target, now_s)
        self.header.show_state(state, words, now_s)
        self.banner.show_words(words)
        self.preview.show_controls(self._controls(state, now_s))
        self.side.show_state(state, now_s)

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: N802 - Qt's name
        """Remembers where it was."""
        self._ticks.stop()
        self._remembered.keep(self, self.splitter)
        super().closeEvent(event)

    def _lay_out(self) -> None:
        left = QWidget()
        column = QVBoxLayout(left)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.video, 1)
        column.addWidget(self.preview)
        column.addWidget(self.plots)
        self.splitter.addWidget(left)
        self.splitter.addWidget(self.side)
        self.splitter.setChildrenCollapsible(False)
        self.splitter.setHandleWidth(_HANDLE_PX)
        # A larger window gives its room to the picture.
        self.splitter.setStretchFactor(0, 1)
        self.splitter.setStretchFactor(1, 0)
        self.splitter.setSizes(_FIRST_DIVISION)
        whole = QVBoxLayout(self)
        top = QHBoxLayout()
        top.addWidget(self.header, 1)
        whole.addLayout(top)
        whole.addWidget(self.banner)
        whole.addWidget(self.splitter, 1)

    def _connect(self, news: News) -> None:
        news.arrived.connect(self.refresh)
        self._ticks = QTimer(self, interval=_TICK_MS)
        self._ticks.timeout.connect(self._tick)
        self._ticks.start()
        self.preview.switched.connect(self._switch)
        self.preview.chosen.connect(self._choose)
        self.banner.retry.connect(self._robot.retry_now)
        QShortcut("P", self, self._switch)
        QShortcut("Q", self, self.close)
        QShortcut("F11", self, self._toggle_full_screen)
        QShortcut("Esc", self, self._leave_full_screen)
        for key, profile in enumerate(PROFILES, start=1):
            QShortcut(str(key), self, partial(self._choose, profile))

    def _tick(self) -> None:
        state, now_s = self._robot.newest(), time.monotonic()
        known = state.snapshot and not state.outdated(now_s)
        self._history.record(now_s, values_of(state.snapshot.status) if known and state.snapshot else NOTHING)
        self.plots.show_history(self._history)
        self.refresh()

    def _controls(self, state: MonitorState, now_s: float) -> Controls:
        now = controls(state, self._marked, now_s)
        if now.wanted:
            self._marked = None
        return now

    def _switch(self) -> None:
        now = self._controls(self._robot.newest(), time.monotonic())
        if now.enabled:
            self._robot.switch(now.switched())
            self.refresh()

    def _choose(self, profile: PreviewProfile) -> None:
        now = self._controls(self._robot.newest(), time.monotonic())
        if not now.enabled:
            return
        if wish := now.chosen(profile):
            self._robot.switch(wish)
        else:
            self._marked = profile
        self.refresh()

    def _toggle_full_screen(self) -> None:
        if self.isFullScreen():
            self.showNormal()
        else:
            self.showFullScreen()

    def _leave_full_screen(self) -> None:
        if self.isFullScreen():
            self.showNormal()
