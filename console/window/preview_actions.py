"""What the preview's buttons and keys do."""

import time

from PySide6.QtCore import QObject, Signal

from console.client import PreviewProfile
from console.monitor.monitor_state import MonitorState
from console.monitor.preview_controls import Controls, controls
from console.monitor.worker import Worker
from console.presentation.preview_switch import next_camera


class PreviewActions(QObject):
    """Sends the operator's requests, and remembers what was selected while the preview is off.

    Args:
        parent: owns this object.
        worker: talks to the gateway.
    """

    acted = Signal()
    """Something was requested or selected."""

    def __init__(self, parent: QObject, worker: Worker) -> None:
        super().__init__(parent)
        self._worker = worker
        self._selected: PreviewProfile | None = None
        self._selected_camera = ""

    def controls(self, state: MonitorState, now_s: float) -> Controls:
        """Returns the controls for a state."""
        now = controls(state, self._selected, now_s, self._selected_camera)
        if now.on:
            self._selected, self._selected_camera = None, ""
        return now

    def switch(self) -> None:
        """Turns the preview on or off."""
        now = self._now()
        if now.enabled:
            self._worker.switch(now.toggled())
            self.acted.emit()

    def choose(self, profile: PreviewProfile) -> None:
        """Requests a profile; while the preview is off, selects it for the next start."""
        now = self._now()
        if not now.enabled:
            return
        if desired := now.with_profile(profile):
            self._worker.switch(desired)
        else:
            self._selected = profile
        self.acted.emit()

    def choose_camera(self, name: str) -> None:
        """Requests a camera; while the preview is off, selects it for the next start."""
        now = self._now()
        if not now.enabled or not name:
            return
        if desired := now.with_camera(name):
            self._worker.switch(desired)
        else:
            self._selected_camera = name
        self.acted.emit()

    def next_camera(self) -> None:
        """Requests or selects the next camera that works."""
        now = self._now()
        self.choose_camera(next_camera(now.cameras, now.wanted_camera))

    def _now(self) -> Controls:
        return self.controls(self._worker.latest(), time.monotonic())
