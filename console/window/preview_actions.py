"""What the preview's buttons and keys do."""

import time

from console.client import PreviewProfile
from console.monitor.monitor_state import MonitorState
from console.monitor.preview_controls import Controls, controls
from console.monitor.worker import Worker


class PreviewActions:
    """Sends the operator's requests, and remembers the profile that was selected while the preview is off.

    Args:
        worker: talks to the gateway.
    """

    def __init__(self, worker: Worker) -> None:
        self._worker = worker
        self._selected: PreviewProfile | None = None

    def controls(self, state: MonitorState, now_s: float) -> Controls:
        """Returns the controls for a state."""
        now = controls(state, self._selected, now_s)
        if now.on:
            self._selected = None
        return now

    def switch(self) -> None:
        """Turns the preview on or off."""
        now = self._now()
        if now.enabled:
            self._worker.switch(now.toggled())

    def choose(self, profile: PreviewProfile) -> None:
        """Requests a profile; while the preview is off, selects it for the next start."""
        now = self._now()
        if not now.enabled:
            return
        if desired := now.with_profile(profile):
            self._worker.switch(desired)
        else:
            self._selected = profile

    def _now(self) -> Controls:
        return self.controls(self._worker.latest(), time.monotonic())
