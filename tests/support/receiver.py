"""The receiver on its own: one connection, without the session that redials and keeps the latest frame."""

import time
from contextlib import suppress
from typing import Final, Self

from console.receiver.address import StreamAddress
from console.receiver.connection import connect
from console.receiver.delivery import Delivery
from console.receiver.errors import StreamError, no_frame_within
from console.receiver.frame import Frame
from console.receiver.frame_queue import FrameQueue
from console.receiver.options import ReceiverOptions
from tests.support.streams import SrtSender

_SHOWN_WITHIN_S: Final = 20.0
_SILENCE_S: Final = 1.0


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


def show_the_first(piece: bytes, sender: SrtSender, viewer: Receiver) -> Frame:
    """Sends a key frame until it comes: a connection that is being made gets nothing of what is sent."""
    deadline_s = time.monotonic() + _SHOWN_WITHIN_S
    assert sender.viewer_joined.wait(_SHOWN_WITHIN_S), "the viewer did not get through"
    sender.viewer_joined.clear()
    sent = 0
    while True:
        sender.send(piece)
        sent += 1
        try:
            frame = viewer.next_frame(_SILENCE_S)
        except NoFrameError:
            assert time.monotonic() < deadline_s, "no frame comes"
        else:
            break
    if sent > 1:
        # More than one may be on its way: what is sent afterwards comes after all of them.
        with suppress(NoFrameError):
            while True:
                viewer.next_frame(_SILENCE_S)
    return frame
