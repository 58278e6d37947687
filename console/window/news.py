"""The one crossing from other threads into Qt's."""

import threading

from PySide6.QtCore import QObject, Qt, Signal


class News(QObject):
    """Says, in the thread that made it, that there is something new; says it once however often it was told.

    Whoever hears it takes the newest there is: a window that is slow for a moment skips what it missed.
    """

    arrived = Signal()
    _told = Signal()

    def __init__(self) -> None:
        super().__init__()
        self._waiting = threading.Event()
        self._told.connect(self._announce, Qt.ConnectionType.QueuedConnection)

    def tell(self) -> None:
        """There is something new. May be called from any thread; only hands over."""
        if not self._waiting.is_set():
            self._waiting.set()
            self._told.emit()

    def _announce(self) -> None:
        # First the flag: what is told from here on is announced again.
        self._waiting.clear()
        self.arrived.emit()
