"""Receives a robot's preview stream as decoded frames."""

import time
from collections.abc import Callable
from typing import Protocol, Self, TypeAlias

from console.receiver.address import StreamAddress
from console.receiver.errors import no_frame_within
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
    """Connects at once and decodes in the background until its block ends.

        with Receiver(StreamAddress("robot.local")) as receiver:
            frame = receiver.next_frame(timeout_s=5)

    Frames that are not taken in time are dropped, oldest first: a slow caller sees fewer frames, never old
    ones. A lost connection stays lost: `console.viewer.session.VideoSession` makes a new receiver for each
    attempt. Belongs to one thread.

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
        self._connection = connect(address, self._queue, options or ReceiverOptions())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self._connection.close()

    def next_frame(self, timeout_s: float) -> Frame:
        """Returns the oldest frame that waits, or the next one to come.

        Raises:
            NoFrameError: none came within `timeout_s` seconds; asking again is fine.
            StreamError: the stream was refused, ended or can't be decoded; the same at every further call.
        """
        taken = self._queue.take(time.monotonic() + timeout_s)
        if isinstance(taken, Frame):
            return taken
        raise no_frame_within(self._address, timeout_s) if taken is None else taken.with_traceback(None)
