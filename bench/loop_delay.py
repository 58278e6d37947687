"""Delay with which Qt's event loop handles an event."""

import time

from PySide6.QtCore import QObject, Qt, QTimer

EVERY_MS = 5


class LoopDelay(QObject):
    """A periodic timer that records how late it fires.

    While the loop is busy, the timer falls due several times but fires once. Each of these moments counts
    with its own delay; otherwise one long blockage would weigh no more than a short one.
    """

    def __init__(self) -> None:
        super().__init__()
        self._delays_ms: list[float] = []
        self._timer = QTimer(self, interval=EVERY_MS, timerType=Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._tick)
        self._before_s = 0.0

    def start(self) -> None:
        """Starts recording; earlier delays are discarded."""
        self._delays_ms.clear()
        self._before_s = time.monotonic()
        self._timer.start()

    def stop(self) -> list[float]:
        """Stops recording and returns all delays, in ms."""
        self._timer.stop()
        return self._delays_ms

    def _tick(self) -> None:
        now_s = time.monotonic()
        late_ms = (now_s - self._before_s) * 1000 - EVERY_MS
        self._before_s = now_s
        self._delays_ms.append(max(0.0, late_ms))
        while (late_ms := late_ms - EVERY_MS) > 0:
            self._delays_ms.append(late_ms)
