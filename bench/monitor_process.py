"""The monitor window under measurement: `python -m bench.monitor_process TARGET SECONDS WIDTH HEIGHT`.

Qt's "offscreen" platform paints into memory with the CPU, as on a laptop without a graphics card. Prints one
JSON object: the delays of the event loop, and how many frames were painted meanwhile.
"""

import json
import os
import sys
import tempfile
from typing import Any

os.environ["QT_QPA_PLATFORM"] = "offscreen"
os.environ["XDG_CONFIG_HOME"] = tempfile.mkdtemp()

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

from bench.loop_delay import LoopDelay
from console.window.programs import monitor

_FRAMES_FIRST = 60
"""Frames painted before the measurement begins: layout and decoder have settled."""
_GIVE_UP_AFTER_S = 60


def main() -> None:
    target, seconds, width, height = sys.argv[1], float(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    app = QApplication([sys.argv[0]])
    app.setStyle("Fusion")
    delay, painted = LoopDelay(), 0
    found: dict[str, Any] = {}

    def on_painted() -> None:
        nonlocal painted
        painted += 1
        if painted == _FRAMES_FIRST:
            delay.start()
            QTimer.singleShot(round(seconds * 1000), finish)

    def finish() -> None:
        found.update(delays_ms=delay.stop(), frames=painted - _FRAMES_FIRST)
        app.quit()

    with monitor(target) as window:
        # The first time it is maximised.
        window.showNormal()
        window.resize(width, height)
        window.video.painted.connect(on_painted)
        QTimer.singleShot(_GIVE_UP_AFTER_S * 1000, app.quit)
        app.exec()
    print(json.dumps(found))


if __name__ == "__main__":
    main()
