"""One robot's status and video together: what every viewer, with or without a window, runs."""

import time
from collections.abc import Callable
from typing import Final

from console.client import PictureReport, PreviewStatus
from console.client.results import Detections
from console.monitor.credential_refresh import LoadCredentials
from console.monitor.link import LinkState
from console.monitor.worker import Connect, Worker, connecting
from console.receiver.delivery import Delivery, DeliveryChoice
from console.receiver.frame import PixelFormat
from console.receiver.recording import Recording
from console.viewer.decoders import Decoders
from console.viewer.picture_meter import PictureMeter
from console.viewer.session import Connect as Receive
from console.viewer.session import VideoSession, open_connection
from console.viewer.thumbnails import Thumbnails

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
        connect: makes the worker's client, in the place of `load`.
        receive: opens connections to the stream; by default over SRT.
        decoders: of the stream.

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
        connect: Connect | None = None,
        receive: Receive = open_connection,
        decoders: Decoders | None = None,
    ) -> None:
        self._on_change = on_change
        self.recording = recording
        self.worker = Worker(
            target,
            self._update_session,
            connect or connecting(load),
            picture=self._report,
            captured=self._captured,
            pictures=Thumbnails(),
        )
        self.meter = PictureMeter(self.worker.clock_offset, self._delivery, self._preview, self._received)
        """Ages of the pictures; what shows them notes them here."""
        self.session = VideoSession(
            pixels=pixels,
            recording=recording,
            decoders=decoders,
            delivery=delivery,
            robot_now_ns=self.meter.robot_now_ns,
            on_picture_lost=self.worker.request_key_frame,
            takes_requests=self.worker.takes_requests,
            connect=receive,
        )

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

    # Worker, meter and session need each other: these are called only once all three exist.

    def _report(self) -> PictureReport | None:
        return self.meter.report()

    def _captured(self) -> int | None:
        return self.meter.capture_ns()

    def _delivery(self) -> Delivery | None:
        return self.session.delivery()

    def _received(self) -> float | None:
        return self.session.received_s()

    def _preview(self) -> PreviewStatus | None:
        snapshot = self.worker.latest().snapshot
        return snapshot.status.preview if snapshot else None

    def _update_session(self) -> None:
        state = self.worker.latest()
        if state.link.state is LinkState.CONNECTED and state.snapshot:
            self.session.follow(state.snapshot.status.preview)
        elif state.link.error:
            self.session.gateway_lost(state.link.error)
        if self.session.latest_frame() is None:
            self.meter.forget()
        if self._on_change:
            self._on_change()
