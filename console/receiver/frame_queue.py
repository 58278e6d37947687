"""Thread hand-over from GStreamer's threads to the caller's: a bounded queue of frames, and its end."""

import threading
import time
from collections import deque

from console.receiver.errors import StreamError
from console.receiver.frame import Frame


class FrameQueue:
    """Bounded queue that drops the oldest frame when it is full. Thread-safe.

    Args:
        size: capacity in frames. With 1 a reader always gets the newest frame.
    """

    def __init__(self, size: int) -> None:
        self._frames: deque[Frame] = deque(maxlen=size)
        self._end: StreamError | None = None
        self._changed = threading.Condition()
        self.newest_s: float | None = None
        """When the newest frame came, on `time.monotonic()`; None before the first."""

    def put(self, frame: Frame) -> None:
        """Appends the newest frame."""
        with self._changed:
            self._frames.append(frame)
            self.newest_s = frame.arrival_s
            self._changed.notify_all()

    def end(self, error: StreamError) -> None:
        """Marks the end of the stream with its cause; the first cause counts."""
        with self._changed:
            self._end = self._end or error
            self._changed.notify_all()

    def take(self, deadline_s: float) -> Frame | StreamError | None:
        """Returns the oldest frame; when none is left, the cause of the end; None at the deadline.

        Args:
            deadline_s: on `time.monotonic()`.
        """
        with self._changed:
            timeout_s = max(0.0, deadline_s - time.monotonic())
            self._changed.wait_for(lambda: self._frames or self._end, timeout_s)
            return self._frames.popleft() if self._frames else self._end
