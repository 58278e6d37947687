"""`robotctl monitor` from its start to its end."""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

from PySide6.QtCore import QMessageLogContext, QtMsgType, qInstallMessageHandler
from PySide6.QtWidgets import QApplication

from common.errors import ExitCode, UserError
from console.monitor.video import overlay_of, pass_on
from console.monitor.worker import Worker
from console.viewer.session import VideoSession
from console.window.monitor_window import MonitorWindow
from console.window.news import News
from console.window.remembered import Remembered
from console.window.video_view import VideoView

_HANG_UP_WITHIN_S = 0.8
"""Each of the two that work in threads of their own: all is over in less than 2 s."""


def run_monitor(target: str) -> None:
    """Shows the window until it is closed.

    Args:
        target: the robot's gateway.

    Raises:
        UserError: the target is no address, or there is no display.
    """
    with _application() as app, monitor(target):
        app.exec()


@contextmanager
def monitor(target: str) -> Iterator[MonitorWindow]:
    """The window and all that works behind it; at the end of the block everything has hung up."""
    news, session = News(), VideoSession()

    def on_news() -> None:
        pass_on(worker.newest(), session)
        news.tell()

    worker = Worker(target, on_news)
    video = VideoView(session, lambda: overlay_of(worker.newest()))
    window = MonitorWindow(worker, news, video, Remembered())
    try:
        session.start()
        worker.start()
        window.show()
        yield window
    finally:
        window.close()
        worker.close(_HANG_UP_WITHIN_S)
        session.close(_HANG_UP_WITHIN_S)


@contextmanager
def _application() -> Iterator[QApplication]:
    _check_display()
    qInstallMessageHandler(_on_qt_message)
    app = QApplication([sys.argv[0]])
    app.setApplicationDisplayName("Robot monitor")
    app.setQuitOnLastWindowClosed(True)
    # One style everywhere, in the desktop's light or dark colours.
    app.setStyle("Fusion")

    def on_signal(_number: int, _frame: FrameType | None) -> None:
        app.closeAllWindows()
        app.quit()

    before = {number: signal.signal(number, on_signal) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield app
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _check_display() -> None:
    on_x11_or_wayland = sys.platform.startswith("linux") and "QT_QPA_PLATFORM" not in os.environ
    if on_x11_or_wayland and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise UserError(
            "there is no display for a window here",
            "Run it on a desktop, over ssh -X, or use: robotctl watch",
        )


def _on_qt_message(kind: QtMsgType, _context: QMessageLogContext, text: str) -> None:
    """Qt's words go to standard error; before it would abort, the program ends with one line."""
    if kind is QtMsgType.QtFatalMsg:
        _end_at_once(UserError(f"Qt can't show a window: {text}", "Check DISPLAY and Qt's libraries"))
    if kind in (QtMsgType.QtCriticalMsg, QtMsgType.QtSystemMsg):
        print(f"Qt: {text}", file=sys.stderr)


def _end_at_once(error: UserError) -> NoReturn:
    print(f"error: {error}", file=sys.stderr, flush=True)
    os._exit(int(ExitCode.FAILED))
