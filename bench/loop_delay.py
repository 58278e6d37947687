"""How long something that happens has to wait until Qt's event loop attends to it."""

import time

from PySide6.QtCore import QObject, Qt, QTimer

EVERY_MS = 5


class LoopDelay(QObject):
    """A timer that notes how late it is.

    While the loop is busy the timer falls due again and again, but is heard once. All these moments count,
    each with its own wait: else a long silence would weigh as much as a short one.
    """

    def __init__(self) -> None:
        super().__init__()
        self._delays_ms: list[float] = []
        self._timer = QTimer(self, interval=EVERY_MS, timerType=Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._tick)
        self._before_s = 0.0

    def start(self) -> None:
        """Begins, and forgets what was before."""
        self._delays_ms.clear()
        self._before_s = time.monotonic()
        self._timer.start()

    def stop(self) -> list[float]:
        """All waits, in ms."""
        self._timer.stop()
        return self._delays_ms

    def _tick(self) -> None:
        now_s = time.monotonic()
        late_ms = (now_s - self._before_s) * 1000 - EVERY_MS
        self._before_s = now_s
        self._delays_ms.append(max(0.0, late_ms))
        while (late_ms := late_ms - EVERY_MS) > 0:
            self._delays_ms.append(late_ms)
