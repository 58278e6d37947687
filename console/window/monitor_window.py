"""The monitor window: one robot, with everything that an operator looks at."""

import time
from functools import partial

from PySide6.QtCore import QSize, Qt, QTimer
from PySide6.QtGui import QCloseEvent
from PySide6.QtWidgets import QSplitter, QVBoxLayout, QWidget

from console.client import PreviewProfile
from console.monitor.history import NOTHING, History, values_of
from console.monitor.link import link_text
from console.monitor.monitor_state import MonitorState
from console.monitor.preview_controls import Controls, controls
from console.monitor.worker import Worker
from console.presentation.preview_switch import PROFILES
from console.window import window_settings
from console.window.handover import ThreadHandover
from console.window.header import ConnectionBanner, Header
from console.window.keys import bind_keys
from console.window.layout import fill
from console.window.plot import Plots
from console.window.preview_panel import PreviewPanel
from console.window.side_panel import SidePanel
from console.window.video_view import VideoView

_TICK_MS = 500
_FIRST_SIZE = QSize(1280, 800)
_DECORATION = QSize(16, 48)
"""What a desktop puts around a window, roughly."""
_HANDLE_PX = 10
_FIRST_DIVISION = (790, 490)


class MonitorWindow(QWidget):
    """Shows the latest state after each change, and twice a second besides: ages grow by themselves.

    Args:
        worker: talks to the gateway; none of its calls here blocks.
        changes: signals changes of the worker's state.
        video: shows the video.
    """

    def __init__(self, worker: Worker, changes: ThreadHandover, video: VideoView) -> None:
        super().__init__()
        self._worker = worker
        self._history = History()
        self._selected: PreviewProfile | None = None
        self.video = video
        self.header, self.banner = Header(worker.target), ConnectionBanner()
        self.preview, self.plots, self.side = PreviewPanel(), Plots(), SidePanel()
        self.splitter = QSplitter(Qt.Orientation.Horizontal)
        self._lay_out()
        self._connect(changes)
        self.setWindowTitle(f"Robot {worker.target}")
        # No larger than a small laptop's screen leaves room for.
        self.resize(_FIRST_SIZE.boundedTo(self.screen().availableSize() - _DECORATION))
        window_settings.restore(self, self.splitter)
        self.refresh()

    def refresh(self) -> None:
        """Shows the latest state."""
        state, now_s = self._worker.latest(), time.monotonic()
        link = link_text(state.link, self._worker.target, now_s)
        self.header.show_state(state, link, now_s)
        self.banner.show_item(link)
        self.preview.show_controls(self._controls(state, now_s))
        self.side.show_state(state, now_s)

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: N802 - Qt's name
        """Saves place and size."""
        self._timer.stop()
        window_settings.save(self, self.splitter)
        super().closeEvent(event)

    def _lay_out(self) -> None:
        left = QWidget()
        fill(QVBoxLayout(left), (self.video, 1), self.preview, self.plots)
        self.splitter.addWidget(left)
        self.splitter.addWidget(self.side)
        self.splitter.setChildrenCollapsible(False)
        self.splitter.setHandleWidth(_HANDLE_PX)
        # A larger window gives its room to the video.
        self.splitter.setStretchFactor(0, 1)
        self.splitter.setStretchFactor(1, 0)
        self.splitter.setSizes(_FIRST_DIVISION)
        whole = QVBoxLayout(self)
        whole.addWidget(self.header)
        whole.addWidget(self.banner)
        whole.addWidget(self.splitter, 1)

    def _connect(self, changes: ThreadHandover) -> None:
        changes.delivered.connect(self.refresh)
        self._timer = QTimer(self, interval=_TICK_MS)
        self._timer.timeout.connect(self._tick)
        self._timer.start()
        self.preview.switched.connect(self._switch)
        self.preview.chosen.connect(self._choose)
        self.banner.retry.connect(self._worker.retry_now)
        profiles = {str(key): partial(self._choose, profile) for key, profile in enumerate(PROFILES, start=1)}
        bind_keys(self, {"P": self._switch, "Q": self.close, **profiles})

    def _tick(self) -> None:
        state, now_s = self._worker.latest(), time.monotonic()
        known = state.snapshot and not state.outdated(now_s)
        self._history.record(now_s, values_of(state.snapshot.status) if known and state.snapshot else NOTHING)
        self.plots.show_history(self._history)
        self.refresh()

    def _controls(self, state: MonitorState, now_s: float) -> Controls:
        now = controls(state, self._selected, now_s)
        if now.on:
            self._selected = None
        return now

    def _switch(self) -> None:
        now = self._controls(self._worker.latest(), time.monotonic())
        if now.enabled:
            self._worker.switch(now.toggled())
            self.refresh()

    def _choose(self, profile: PreviewProfile) -> None:
        now = self._controls(self._worker.latest(), time.monotonic())
        if not now.enabled:
            return
        if desired := now.with_profile(profile):
            self._worker.switch(desired)
        else:
            self._selected = profile
        self.refresh()
