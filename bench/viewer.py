"""What the window adds to the latency: capture to the painted frame, against capture to decoded.

The preview's frames carry the moment of their capture (bench/video/stamp.py). The bare receiver reads it
behind the decoder; the viewer's is read back from the pixels of its window, after they were painted. Both
watch the same robot in turns.
"""

import os
import statistics
import tempfile
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path

from PySide6.QtCore import QEventLoop, QPoint, QRect, QTimer
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QApplication, QWidget

from bench.progress import log
from bench.rows import Row
from bench.video import product, stamp
from bench.video.camera import HEIGHT_PX, WIDTH_PX, camera
from bench.video.viewing import watch
from console.viewer.session import VideoSession
from console.window.video_view import VideoView

NAME = "viewer.extra_latency_frames"
ROUNDS = 5
SETTLE_S = 1.0
WATCH_S = 3.0
LATENCY_MS = 20
FPS = 30


def run(_names: list[str]) -> list[Row]:
    with tempfile.TemporaryDirectory() as directory:
        extra_ms = list(extra_latency_ms(Path(directory), ROUNDS))
    return [
        Row(
            name=NAME,
            what=f"capture to painted in the window, less capture to decoded by the receiver (720p{FPS})",
            unit="frames",
            values=[each * FPS / 1000 for each in extra_ms],
            bar=1.5,
        )
    ]


def extra_latency_ms(workdir: Path, rounds: int) -> Generator[float, None, None]:
    """What the window adds, round by round: the difference of the medians of both sides."""
    with camera(workdir, FPS) as source, product.robot(workdir, source, LATENCY_MS) as robot, robot.preview():
        for _ in range(rounds):
            with robot.viewer() as receiver:
                watch(receiver, SETTLE_S)
                bare = statistics.median(one.latency_ms for one in watch(receiver, WATCH_S))
            painted = statistics.median(_painted_ms(robot))
            log(f"decoded after {bare:.1f} ms, painted after {painted:.1f} ms")
            yield painted - bare


def _painted_ms(robot: product.Robot) -> list[float]:
    """Capture to painted, of each frame that the window showed."""
    found: list[float] = []
    with _window(robot) as view:

        def look() -> None:
            seen_s = time.monotonic()
            captured_s = read_stamp(on_screen(view))
            if captured_s is not None:
                found.append((seen_s - captured_s) * 1000)

        _let_pass(SETTLE_S)
        # Behind the painting: what is on the screen then is what was painted.
        view.painted.connect(lambda: QTimer.singleShot(0, look))
        _let_pass(WATCH_S)
    return found


def on_screen(widget: QWidget) -> QImage:
    """What has been painted of a widget, without painting it again."""
    window = widget.window()
    whole = window.screen().grabWindow(window.winId()).toImage()
    return whole.copy(QRect(widget.mapTo(window, QPoint(0, 0)), widget.size()))


def read_stamp(frame: QImage) -> float | None:
    """The moment that is drawn into a frame shown in its own size, from its upper left corner on."""
    grey = frame.convertToFormat(QImage.Format.Format_Grayscale8)
    first = grey.bytesPerLine() * (stamp.BLOCK_PX // 2)
    row = bytes(grey.constBits()[first : first + min(stamp.WIDTH_PX, grey.width())])
    return stamp.read(row) if len(row) == stamp.WIDTH_PX else None


@contextmanager
def _window(robot: product.Robot) -> Iterator[VideoView]:
    # A window nobody sees, also where there is no screen.
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    _app = QApplication.instance() or QApplication(["bench"])
    session = VideoSession()
    session.start()
    view = VideoView(session, lambda: None)
    try:
        view.resize(WIDTH_PX, HEIGHT_PX)
        view.show()
        session.follow(robot.client.status().preview)
        yield view
    finally:
        view.close()
        session.close()


def _let_pass(seconds: float) -> None:
    loop = QEventLoop()
    QTimer.singleShot(round(seconds * 1000), loop.quit)
    loop.exec()
