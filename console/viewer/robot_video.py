"""One robot's status and video together: what every viewer, with or without a window, runs."""

import time
from collections.abc import Callable
from typing import Final

from console.client.results import Detections
from console.monitor.credential_refresh import LoadCredentials
from console.monitor.link import LinkState
from console.monitor.worker import Worker, connecting
from console.receiver.delivery import DeliveryChoice
from console.receiver.frame import PixelFormat
from console.receiver.recording import Recording
from console.viewer.session import VideoSession

_SILENT_AFTER_S: Final = 1.0
"""Silence of the robot after which its boxes are not drawn: they may be wrong by then."""


class RobotVideo:
    """A gateway worker, and a video session that follows its status.

    Args:
        target: the robot's gateway, HOST:PORT.
        load: reads the stored credentials; by default there are none.
        pixels: pixel format of the frames.
        recording: keeps the encoded stream, too; closed together with the session.
        delivery: how packets are delivered.
        on_change: called after each change of the status, in the worker's thread; must only hand over.

    Raises:
        UserError: the target is not an address, or the credentials can't be used.
    """

    def __init__(
        self,
        target: str,
        load: LoadCredentials | None = None,
        *,
        pixels: PixelFormat = PixelFormat.BGRX,
        recording: Recording | None = None,
        delivery: DeliveryChoice = DeliveryChoice.AUTO,
        on_change: Callable[[], None] | None = None,
    ) -> None:
        self._on_change = on_change
        self.recording = recording
        self.session = VideoSession(pixels=pixels, recording=recording, delivery=delivery)
        self.worker = Worker(target, self._update_session, connecting(load))

    def start(self) -> None:
        """Starts both threads."""
        self.session.start()
        self.worker.start()

    def detections(self) -> Detections | None:
        """Returns the latest detections; None before the first status, and while the robot is silent."""
        state = self.worker.latest()
        silent = time.monotonic() - state.heard_s > _SILENT_AFTER_S
        return state.snapshot.detections if state.snapshot and not silent else None

    def close(self, timeout_s: float) -> None:
        """Disconnects both, within `timeout_s` each, and closes the recording."""
        self.worker.close(timeout_s)
        # A session that still runs may still write to the recording.
        if self.session.close(timeout_s) and self.recording:
            self.recording.close()

    def _update_session(self) -> None:
        state = self.worker.latest()
        if state.link.state is LinkState.CONNECTED and state.snapshot:
            self.session.follow(state.snapshot.status.preview)
        elif state.link.error:
            self.session.gateway_lost(state.link.error)
        if self._on_change:
            self._on_change()
