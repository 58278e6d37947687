"""Latency that the window adds: capture to the painted frame, less capture to decoded.

The preview's frames carry the moment of their capture (bench/video/stamp.py). With the bare receiver it is
read behind the decoder, with the viewer from the pixels of its window after they were painted. Both watch
the same robot in turns.
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


def extra_latency_ms(workdir: Path, rounds: int, watch_s: float = WATCH_S) -> Generator[float, None, None]:
    """Yields the difference of the medians of both sides for each round, in ms.

    Args:
        workdir: for files.
        rounds: how many.
        watch_s: how long each side watches in a round.
    """
    with camera(workdir, FPS) as source, product.robot(workdir, source, LATENCY_MS) as robot, robot.preview():
        for _ in range(rounds):
            with robot.viewer() as receiver:
                watch(receiver, SETTLE_S)
                bare = statistics.median(one.latency_ms for one in watch(receiver, watch_s))
            painted = statistics.median(_painted_ms(robot, watch_s))
            log(f"decoded after {bare:.1f} ms, painted after {painted:.1f} ms")
            yield painted - bare


def _painted_ms(robot: product.Robot, watch_s: float) -> list[float]:
    """Returns the time from capture to painted of each frame that the window showed, in ms."""
    found: list[float] = []
    with _window(robot) as view:

        def look() -> None:
            seen_s = time.monotonic()
            captured_s = read_stamp(on_screen(view))
            if captured_s is not None:
                found.append((seen_s - captured_s) * 1000)

        _let_pass(SETTLE_S)
        # A timer of 0 ms fires after the painting, when the screen has the new frame.
        view.painted.connect(lambda: QTimer.singleShot(0, look))
        _let_pass(watch_s)
    return found


def on_screen(widget: QWidget) -> QImage:
    """Returns the pixels of a widget as they were painted, without painting it again."""
    window = widget.window()
    whole = window.screen().grabWindow(window.winId()).toImage()
    return whole.copy(QRect(widget.mapTo(window, QPoint(0, 0)), widget.size()))


def read_stamp(frame: QImage) -> float | None:
    """Returns the stamp of a frame that is shown in its own size; None when it can't be read."""
    grey = frame.convertToFormat(QImage.Format.Format_Grayscale8)
    first = grey.bytesPerLine() * (stamp.BLOCK_PX // 2)
    row = bytes(grey.constBits()[first : first + min(stamp.WIDTH_PX, grey.width())])
    return stamp.read(row) if len(row) == stamp.WIDTH_PX else None


@contextmanager
def _window(robot: product.Robot) -> Iterator[VideoView]:
    # Works without a screen, and shows no window where there is one.
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
