"""The receiver on its own: one connection, without the session that redials and keeps the latest frame."""

import time
from typing import Self

from console.receiver.address import StreamAddress
from console.receiver.connection import connect
from console.receiver.delivery import Delivery
from console.receiver.errors import StreamError, no_frame_within
from console.receiver.frame import Frame
from console.receiver.frame_queue import FrameQueue
from console.receiver.options import ReceiverOptions


class NoFrameError(StreamError):
    """No frame came before the caller's timeout. The receiver goes on; asking again is fine."""


class Receiver:
    """Connects at once and decodes in the background until its block ends.

    Frames that are not taken in time are dropped, oldest first. A lost connection stays lost.

    Args:
        address: SRT listener to connect to.
        queue_size: how many decoded frames may wait for the caller.
        options: of the receiver.
    """

    def __init__(
        self, address: StreamAddress, *, queue_size: int = 2, options: ReceiverOptions | None = None
    ) -> None:
        self._address = address
        self._queue = FrameQueue(queue_size)
        self._connection = connect(address, self._queue, options or ReceiverOptions())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self._connection.close()

    @property
    def delivery(self) -> Delivery:
        """The delivery in use, with its figures."""
        return self._connection.delivery

    def next_frame(self, timeout_s: float) -> Frame:
        """Returns the oldest frame that waits, or the next one to come.

        Raises:
            NoFrameError: none came within `timeout_s` seconds; asking again is fine.
            StreamError: the stream was refused, ended or can't be decoded; the same at every further call.
        """
        taken = self._queue.take(time.monotonic() + timeout_s)
        if isinstance(taken, Frame):
            return taken
        if taken is None:
            silence = no_frame_within(self._address, timeout_s)
            raise NoFrameError(silence.what, silence.remedy)
        raise taken.with_traceback(None)
