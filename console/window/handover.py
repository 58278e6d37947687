"""Thread hand-over into Qt: the one way by which other threads reach a window."""

import threading

from PySide6.QtCore import QObject, Qt, Signal


class ThreadHandover(QObject):
    """Emits `delivered` in the thread that made it, after calls of `post` in any thread; coalesces them.

    A receiver reads the latest state: a window that is slow for a moment skips what it missed.
    """

    delivered = Signal()
    _posted = Signal()

    def __init__(self) -> None:
        super().__init__()
        self._pending = threading.Event()
        self._posted.connect(self._deliver, Qt.ConnectionType.QueuedConnection)

    def post(self) -> None:
        """Schedules `delivered`. Thread-safe; returns at once."""
        if not self._pending.is_set():
            self._pending.set()
            self._posted.emit()

    def _deliver(self) -> None:
        # First the flag: a change posted from here on is delivered again.
        self._pending.clear()
        self.delivered.emit()
