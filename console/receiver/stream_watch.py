"""Reads a transport stream beside GStreamer's demultiplexer, for what that does not pass on. Pure."""

import threading
from collections import deque
from typing import Final

from console.receiver.transport_stream import AccessUnit, TransportStream, UnknownVideoError

_MOST: Final = 32
"""Access units on their way to the demultiplexer's output, and torn ones on theirs through the decoder."""


class StreamWatch:
    """Knows which frames of SRT's own delivery are torn.

    GStreamer's demultiplexer leaves out an access unit that is damaged, marks nothing, and goes on with those
    that depend on it; decoders conceal what they lack. Where it passes on one that `TransportStream`
    withholds, the frame is torn. The two give whole access units in the same order, and with the same size.

    `take` and `note` belong to the thread that feeds the demultiplexer, `is_torn` to that of the decoder,
    which may be another one.
    """

    def __init__(self) -> None:
        self._stream = TransportStream()
        self._whole: deque[AccessUnit] = deque(maxlen=_MOST)
        """Those that the demultiplexer has not passed on yet."""
        self._agrees = False
        """Whether any has been found there; before that nothing follows from one that is not."""
        self._lock = threading.Lock()
        self._torn: dict[int, bool] = {}
        """Times of torn frames that the decoder has not given yet."""

    def take(self, payload: bytes) -> None:
        """Takes what the demultiplexer gets next."""
        try:
            self._whole.extend(self._stream.feed(payload))
        except UnknownVideoError:
            return  # The demultiplexer reports it.

    def note(self, size: int, time_ns: int) -> None:
        """Notes an access unit that the demultiplexer passes on.

        Args:
            size: its bytes.
            time_ns: the demultiplexer's time for it.
        """
        if self._found(size):
            self._agrees = True
        elif self._agrees:
            with self._lock:
                self._torn[time_ns] = True
                if len(self._torn) > _MOST:
                    # Of a frame that the decoder has dropped.
                    del self._torn[next(iter(self._torn))]

    def is_torn(self, time_ns: int) -> bool:
        """Returns whether the frame of this time is torn; asked once for each."""
        with self._lock:
            return self._torn.pop(time_ns, False)

    def _found(self, size: int) -> bool:
        """Returns whether an access unit of this size is due, and drops it and those before it."""
        sizes = [len(unit.data) for unit in self._whole]
        if size not in sizes:
            return False
        for _ in range(sizes.index(size) + 1):
            self._whole.popleft()
        return True
