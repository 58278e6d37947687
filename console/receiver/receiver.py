"""Receives a robot's preview stream as decoded frames."""

import threading
import time
from collections.abc import Callable
from typing import Protocol, Self, TypeAlias

from console.receiver.address import StreamAddress
from console.receiver.errors import closed, no_frame_within
from console.receiver.frame import Frame
from console.receiver.frame_queue import FrameQueue
from console.receiver.options import ReceiverOptions


class OpenConnection(Protocol):
    """A connection that is established or under way."""

    def close(self) -> None:
        """Disconnects; afterwards nothing reaches the queue."""


Connect: TypeAlias = Callable[[StreamAddress, FrameQueue, ReceiverOptions], OpenConnection]


def open_connection(address: StreamAddress, queue: FrameQueue, options: ReceiverOptions) -> OpenConnection:
    """Opens a connection over SRT.

    Raises:
        UserError: GStreamer or one of its elements is not installed.
    """
    # Imported here so that a program without GStreamer fails only when it receives video.
    from console.receiver.connection import Connection  # noqa: PLC0415

    return Connection(address, queue, options)


class Receiver:
    """Connects at once and decodes in the background until it is closed.

        with Receiver(StreamAddress("robot.local")) as receiver:
            frame = receiver.next_frame(timeout_s=5)

    Frames that are not taken in time are dropped, oldest first: a slow caller sees fewer frames, never old
    ones. A lost connection stays lost: `console.viewer.session.VideoSession` makes a new receiver for each
    attempt. `next_frame` belongs to one thread; `close` may be called from any.

    Args:
        address: SRT listener to connect to.
        queue_size: how many decoded frames may wait for the caller.
        options: pixel format, decoders and recording.
        connect: opens the connection; tests pass a double.

    Raises:
        UserError: GStreamer or one of its elements is not installed.
    """

    def __init__(
        self,
        address: StreamAddress,
        *,
        queue_size: int = 2,
        options: ReceiverOptions | None = None,
        connect: Connect = open_connection,
    ) -> None:
        self._address = address
        self._queue = FrameQueue(queue_size)
        self._closing = threading.Lock()
        self._closed = False
        self._connection = connect(address, self._queue, options or ReceiverOptions())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    @property
    def received(self) -> int:
        """Frames decoded so far."""
        return self._queue.received

    @property
    def dropped(self) -> int:
        """Frames decoded but dropped because the caller was slow."""
        return self._queue.dropped

    def next_frame(self, timeout_s: float) -> Frame:
        """Returns the oldest frame that waits, or the next one to come.

        Raises:
            NoFrameError: none came within `timeout_s` seconds; asking again is fine.
            ReceiverClosedError: the receiver was closed.
            StreamError: the stream was refused, ended or can't be decoded; the same at every further call.
        """
        taken = self._queue.take(time.monotonic() + timeout_s)
        if self._closed:
            raise closed()
        if isinstance(taken, Frame):
            return taken
        raise no_frame_within(self._address, timeout_s) if taken is None else taken.with_traceback(None)

    def close(self) -> None:
        """Disconnects; a waiting `next_frame` raises `ReceiverClosedError`. Closing again does nothing."""
        with self._closing:
            if self._closed:
                return
            self._closed = True
            self._queue.end(closed())
            self._connection.close()
