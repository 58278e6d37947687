"""Thread hand-over into Qt: the one way by which other threads reach a window."""

import threading

from PySide6.QtCore import QObject, Qt, Signal


class ThreadHandover(QObject):
    """Emits `delivered` in the thread that made it, after calls of `post` in any thread; coalesces them.

    A receiver reads the latest state: a window that is slow for a moment skips what it missed.

    Args:
        parent: deletes this object, in the window's thread. Without one Python would, in whichever thread
            drops the last reference or collects garbage, while Qt may be delivering the signal.
    """

    delivered = Signal()
    _posted = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._lock = threading.Lock()
        self._pending = False
        self._closed = False
        self._posted.connect(self._deliver, Qt.ConnectionType.QueuedConnection)

    def post(self) -> None:
        """Schedules `delivered`. Thread-safe; returns at once; does nothing once closed."""
        with self._lock:
            if not (self._pending or self._closed):
                self._pending = True
                self._posted.emit()

    def close(self) -> None:
        """Ends the hand-over: when this returns, no other thread uses the object any more."""
        with self._lock:
            self._closed = True

    def _deliver(self) -> None:
        # First the flag: a change posted from here on is delivered again.
        with self._lock:
            self._pending = False
        self.delivered.emit()
