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
from bench.video.window import Glance
from console.viewer.picture_meter import PictureMeter
from console.viewer.robot_video import RobotVideo
from console.window.video_view import VideoView

NAME = "viewer.extra_latency_frames"
ROUNDS = 5
SETTLE_S = 1.0
WATCH_S = 3.0
LATENCY_MS = 20
FPS = 30
_CLOSE_TIMEOUT_S = 5.0


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
            painted = statistics.median(one.latency_ms for one in painted_frames(robot, watch_s))
            log(f"decoded after {bare:.1f} ms, painted after {painted:.1f} ms")
            yield painted - bare


def painted_frames(robot: product.Robot, watch_s: float, settle_s: float = SETTLE_S) -> list[Glance]:
    """Returns the frames that the window showed, by when they had been painted."""
    found: list[Glance] = []
    with _window(robot) as (view, meter):

        def look() -> None:
            seen_s, shown = time.monotonic(), meter.latest()
            captured_s = read_stamp(_stamp_on_screen(view))
            if captured_s is not None:
                # The viewer's age is that of the moment when it had painted the frame.
                error_ms = abs((shown.at_s - captured_s) * 1000 - shown.age_ms) if shown else None
                found.append(Glance(captured_s, seen_s, error_ms=error_ms))

        _let_pass(settle_s)
        # A timer of 0 ms fires after the painting, when the screen has the new frame.
        painted = view.painted.connect(lambda: QTimer.singleShot(0, look))
        _let_pass(watch_s)
        # Else the view and this function would keep each other, and the robot's connections with them.
        view.painted.disconnect(painted)
    return found


def on_screen(widget: QWidget) -> QImage:
    """Returns the pixels of a widget as they were painted, without painting it again."""
    window = widget.window()
    whole = window.screen().grabWindow(window.winId()).toImage()
    return whole.copy(QRect(widget.mapTo(window, QPoint(0, 0)), widget.size()))


def _stamp_on_screen(widget: QWidget) -> QImage:
    """Returns the upper left corner as it was painted: more of it would take the time of the next frame."""
    window = widget.window()
    corner = widget.mapTo(window, QPoint(0, 0))
    found = window.screen().grabWindow(window.winId(), corner.x(), corner.y(), stamp.WIDTH_PX, stamp.BLOCK_PX)
    return found.toImage()


def read_stamp(frame: QImage) -> float | None:
    """Returns the stamp of a frame that is shown in its own size; None when it can't be read."""
    grey = frame.convertToFormat(QImage.Format.Format_Grayscale8)
    first = grey.bytesPerLine() * (stamp.BLOCK_PX // 2)
    row = bytes(grey.constBits()[first : first + min(stamp.WIDTH_PX, grey.width())])
    return stamp.read(row) if len(row) == stamp.WIDTH_PX else None


@contextmanager
def _window(robot: product.Robot) -> Iterator[tuple[VideoView, PictureMeter]]:
    # Works without a screen, and shows no window where there is one.
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    _app = QApplication.instance() or QApplication(["bench"])
    followed = RobotVideo(robot.client.target)
    view = VideoView(followed.session, lambda: None, followed.meter)
    # What is painted in the corner must not hide the stamp.
    view.show_age(False)
    try:
        view.resize(WIDTH_PX, HEIGHT_PX)
        view.show()
        followed.start()
        yield view, followed.meter
    finally:
        view.close()
        view.deleteLater()
        followed.close(_CLOSE_TIMEOUT_S)


def _let_pass(seconds: float) -> None:
    loop = QEventLoop()
    QTimer.singleShot(round(seconds * 1000), loop.quit)
    loop.exec()
