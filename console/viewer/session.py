"""Video session: one robot's preview for as long as a viewer is open; redials, and keeps the latest frame."""

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Final, Protocol, TypeAlias

from common.errors import UserError
from common.suspend import SuspendedTime
from console.capture_time import CaptureClock
from console.client import GatewayError, PreviewState, PreviewStatus
from console.receiver.address import StreamAddress
from console.receiver.delivery import Delivery, DeliveryChoice
from console.receiver.errors import (
    NoPictureError,
    ReceiverFailedError,
    StreamError,
    UndecodableError,
    hung_too_often,
    no_frame_within,
)
from console.receiver.frame import Frame, PixelFormat
from console.receiver.frame_queue import FrameQueue
from console.receiver.options import ReceiverOptions, RequestKeyFrame
from console.receiver.recording import Recording
from console.viewer.decoders import Decoders
from console.viewer.playback import Playback, PlaybackInputs, playback
from console.viewer.redial import (
    BLOCKED_PAUSE_S,
    FIRST_FRAME_TIMEOUT_S,
    address_of,
    deadline_s,
    no_picture_backoff,
    redial_backoff,
)

_MOST_HUNG: Final = 3
"""Connections that may be left behind: each keeps a thread, and maybe a driver."""
_POLL_S: Final = 0.1
"""Period, while no frame comes, of checking whether the connection is still needed."""

RobotTime: TypeAlias = Callable[[], int | None]
FrameListener: TypeAlias = Callable[[Frame], None]


class OpenConnection(Protocol):
    """A connection that is established or under way."""

    @property
    def delivery(self) -> Delivery:
        """The delivery in use, with its figures."""

    @property
    def received_s(self) -> float | None:
        """When the newest frame was received, decoded or not, on `time.monotonic()`; None if unknown."""

    def close(self) -> bool:
        """Disconnects; afterwards nothing reaches the queue. Returns whether it ended in time."""


Connect: TypeAlias = Callable[[StreamAddress, FrameQueue, ReceiverOptions], OpenConnection]


def open_connection(address: StreamAddress, queue: FrameQueue, options: ReceiverOptions) -> OpenConnection:
    """Opens a connection over SRT.

    Raises:
        UserError: GStreamer or one of its elements is not installed.
    """
    # Imported here so that a program without GStreamer fails only when it receives video.
    from console.receiver.connection import connect  # noqa: PLC0415

    return connect(address, queue, options)


class VideoSession:
    """Follows the stream that the robot's gateway announces until it is closed.

        session = VideoSession()
        session.start()
        session.follow(robot.status().preview)   # after each new status

    Thread-safe; every method but `close` returns at once. The session disconnects after a second of silence
    and redials with short pauses; it connects to another address as soon as the status has one.

    Args:
        pixels: pixel format of the frames.
        recording: keeps the encoded stream, too; the caller closes it.
        decoders: choice of the decoders; by default hardware that has passed its trial, else software.
        delivery: how packets are delivered.
        robot_now_ns: reads the estimate of the robot's monotonic clock, in ns; None while there is none.
            Without it frames have no capture time.
        on_picture_lost: requests a key frame; see `ReceiverOptions`. Without it the receiver connects anew.
        takes_requests: whether such a request still has a prospect.
        connect: opens connections; tests pass a double.
    """

    def __init__(
        self,
        *,
        pixels: PixelFormat = PixelFormat.BGRX,
        recording: Recording | None = None,
        decoders: Decoders | None = None,
        delivery: DeliveryChoice = DeliveryChoice.AUTO,
        robot_now_ns: RobotTime | None = None,
        on_picture_lost: RequestKeyFrame | None = None,
        takes_requests: Callable[[], bool] = lambda: True,
        connect: Connect = open_connection,
    ) -> None:
        self._pixels = pixels
        self._recording = recording
        self._decoders = decoders or Decoders()
        self._delivery = delivery
        self._robot_now_ns = robot_now_ns
        self._on_picture_lost = on_picture_lost
        self._takes_requests = takes_requests
        self._connect = connect
        self._connection: OpenConnection | None = None
        self._hung = 0
        """Connections that were left behind, because they could not be closed."""
        self._backoff = redial_backoff()
        self._no_picture_backoff = no_picture_backoff()
        self._changed = threading.Condition()
        self._inputs = PlaybackInputs()
        self._address: StreamAddress | None = None
        self._latest: Frame | None = None
        self._suspended = SuspendedTime()
        """Since the latest frame came."""
        self._listeners: list[FrameListener] = []
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="video-session", daemon=True)
        self.frames = 0
        """Frames taken so far."""

    def start(self) -> None:
        """Starts the thread; it connects once an address is known."""
        self._decoders.start()
        self._thread.start()

    def add_frame_listener(self, listener: FrameListener) -> None:
        """Calls `listener` with every further frame, in the session's thread; it must only hand over."""
        self._listeners.append(listener)

    def follow(self, preview: PreviewStatus) -> None:
        """Takes the gateway's latest status: whether there is a stream, and its address."""
        try:
            address, invalid = address_of(preview), None
        except UserError as error:
            address, invalid = None, error
        with self._changed:
            before = self._inputs.preview
            self._inputs = replace(self._inputs, preview=preview, gateway_error=None)
            if invalid:
                self._inputs = replace(self._inputs, stream_error=invalid, blocked=True)
            if preview.state is PreviewState.RUNNING and before and before.state is not PreviewState.RUNNING:
                self._reset_backoff()
                self._changed.notify_all()
            if address != self._address:
                self._address = address
                if not invalid:
                    self._inputs = replace(self._inputs, stream_error=None, blocked=False)
                self._changed.notify_all()
            if preview.state is PreviewState.DISABLED:
                self._latest = None
                self._inputs = replace(self._inputs, frame_s=None, stream_error=None, blocked=False)

    def gateway_lost(self, error: GatewayError) -> None:
        """Notes that the gateway does not answer. The stream goes on without it."""
        with self._changed:
            self._inputs = replace(self._inputs, gateway_error=error)

    def latest_frame(self) -> Frame | None:
        """Returns the latest frame; None when there is none to show."""
        return self._latest

    def playback(self) -> Playback:
        """Returns the state of the video at this moment."""
        # In a suspend the monotonic clock stands still, and the frame on the screen gets older all the same.
        return playback(self._inputs, time.monotonic() + self._suspended.seconds())

    @property
    def redials(self) -> int:
        """How often the stream was connected to again after it was lost or fell silent."""
        return self._inputs.redials

    def delivery(self) -> Delivery | None:
        """Returns how packets are delivered, with the figures of the latest connection; None before one."""
        connection = self._connection
        return connection.delivery if connection else None

    def received_s(self) -> float | None:
        """Returns when the newest frame was received, decoded or not; None if unknown."""
        connection = self._connection
        return connection.received_s if connection else None

    def close(self, timeout_s: float = 2.0) -> bool:
        """Disconnects. Returns whether the thread ended in time. Closing again does nothing."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        if self._thread.ident is not None:
            self._thread.join(timeout_s)
        return not self._thread.is_alive()

    # In the session's thread.

    def _run(self) -> None:
        while not self._closing:
            address = self._address
            if address is None:
                self._wait(lambda: self._address is not None)
                continue
            if self._hung >= _MOST_HUNG:
                self._update(stream_error=hung_too_often(self._hung), blocked=True)
                self._wait(lambda: self._address != address)  # noqa: B023 - called at once
                continue
            error = self._receive(address)
            if self._closing or address != self._address:
                continue
            blocked = not isinstance(error, StreamError) or error.final
            self._update(stream_error=error, blocked=blocked)
            pause_s = BLOCKED_PAUSE_S if blocked else self._pause_after(error)
            self._wait(lambda: self._address != address, pause_s)  # noqa: B023 - called at once
            self._update(redials=self._inputs.redials + 1)

    def _pause_after(self, error: UserError) -> float:
        in_vain = isinstance(error, NoPictureError | ReceiverFailedError)
        return (self._no_picture_backoff if in_vain else self._backoff).next_s()

    def _reset_backoff(self) -> None:
        self._backoff.reset()
        self._no_picture_backoff.reset()

    def _receive(self, address: StreamAddress) -> UserError:
        """Takes the frames of one connection, and returns why it ended."""
        queue = FrameQueue(1)
        try:
            connection = self._connect(address, queue, self._options(address))
        except UserError as error:
            return error
        self._connection = connection
        try:
            end = self._take_frames(connection, queue, address)
        finally:
            closed = connection.close()
        if not closed:
            self._hung += 1
            return self._decoders.after_hang()
        return self._decoders.after_undecodable(end) if isinstance(end, UndecodableError) else end

    def _options(self, address: StreamAddress) -> ReceiverOptions:
        capture = None
        if address.capture_offset_ns is not None and self._robot_now_ns:
            capture = CaptureClock(address.capture_offset_ns, self._robot_now_ns)
        return ReceiverOptions(
            self._pixels,
            self._decoders.chosen(),
            self._recording,
            self._delivery,
            capture,
            on_picture_lost=self._on_picture_lost,
            takes_requests=self._takes_requests,
        )

    def _take_frames(
        self, connection: OpenConnection, queue: FrameQueue, address: StreamAddress
    ) -> StreamError:
        connected_s, frame_s, rejoins = time.monotonic(), None, connection.delivery.rejoins
        while not self._closing and address == self._address:
            if connection.delivery.rejoins != rejoins:
                # It knows why no frame comes, and has done what can be done.
                connected_s, frame_s, rejoins = time.monotonic(), None, connection.delivery.rejoins
            match queue.take(time.monotonic() + _POLL_S):
                case Frame() as frame:
                    frame_s = frame.arrival_s
                    self._take(frame)
                case StreamError() as end:
                    return end
                case None if time.monotonic() > deadline_s(connected_s, frame_s):
                    if frame_s:
                        return StreamError(f"the stream from {address.uri} fell silent", "")
                    self._decoders.after_no_frame()
                    return no_frame_within(address, FIRST_FRAME_TIMEOUT_S)
        return StreamError("this stream is not needed any more", "")

    def _take(self, frame: Frame) -> None:
        with self._changed:
            if self._address is None:
                return
            self._latest, self._suspended = frame, SuspendedTime()
            self.frames += 1
            self._inputs = replace(self._inputs, frame_s=frame.arrival_s, stream_error=None, blocked=False)
            self._reset_backoff()
        for listener in self._listeners:
            listener(frame)

    def _update(self, **changes: object) -> None:
        with self._changed:
            self._inputs = replace(self._inputs, **changes)  # type: ignore[arg-type]

    def _wait(self, unless: Callable[[], bool], seconds: float | None = None) -> None:
        with self._changed:
            self._changed.wait_for(lambda: self._closing or unless(), seconds)
