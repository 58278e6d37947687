"""The one crossing from GStreamer's threads to the caller's: a bounded queue of pictures, and its end."""

import threading
import time
from collections import deque

from console.receiver.errors import StreamError
from console.receiver.frame import Frame


class Inbox:
    """Holds the newest pictures; when it is full the oldest goes.

    Everything may be called from any thread.

    Args:
        size: how many pictures it holds. 1 gives a viewer always the newest one.
    """

    def __init__(self, size: int) -> None:
        self._frames: deque[Frame] = deque(maxlen=size)
        self._end: StreamError | None = None
        self._news = threading.Condition()
        self.received = 0
        """Pictures put in so far."""
        self.dropped = 0
        """Pictures thrown away because nobody took them in time."""

    def put(self, frame: Frame) -> None:
        """Adds the newest picture."""
        with self._news:
            self.dropped += len(self._frames) == self._frames.maxlen
            self.received += 1
            self._frames.append(frame)
            self._news.notify_all()

    def end(self, trouble: StreamError) -> None:
        """Says that no more pictures come, and why. The first reason counts."""
        with self._news:
            self._end = self._end or trouble
            self._news.notify_all()

    def reopen(self) -> None:
        """Forgets the end, but no picture: a new connection fills the same inbox."""
        with self._news:
            self._end = None

    def take(self, deadline_s: float) -> Frame | StreamError | None:
        """The oldest picture held; or, when none is left, why no more come; or None at the deadline.

        Args:
            deadline_s: on `time.monotonic()`.
        """
        with self._news:
            self._news.wait_for(lambda: self._frames or self._end, max(0.0, deadline_s - time.monotonic()))
            return self._frames.popleft() if self._frames else self._end
