"""The Qt application of a program with a window: display, style, signals, Qt's own messages."""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from PySide6.QtCore import QMessageLogContext, QTimer, QtMsgType, qInstallMessageHandler
from PySide6.QtWidgets import QApplication

from common.errors import ExitCode, UserError


@contextmanager
def application(title: str) -> Iterator[QApplication]:
    """Makes the program's one QApplication; SIGINT and SIGTERM close its windows.

    Python sees a signal only when Qt calls some Python: every window of ours has a timer that does.

    Args:
        title: application name, behind the title of each window.

    Raises:
        UserError: there is no display.
    """
    _check_display()
    qInstallMessageHandler(_on_qt_message)
    app = QApplication([sys.argv[0]])
    app.setApplicationDisplayName(title)
    app.setQuitOnLastWindowClosed(True)
    # One style everywhere, in the desktop's light or dark colours.
    app.setStyle("Fusion")

    def end() -> None:
        app.closeAllWindows()
        app.quit()

    def on_signal(_number: int, _frame: FrameType | None) -> None:
        # In the event loop: before it runs, quitting does nothing, and the signal would be lost.
        QTimer.singleShot(0, end)

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
            "Run it on a desktop or over ssh -X; without a window: robotctl watch, robotctl view --headless",
        )


def _on_qt_message(kind: QtMsgType, _context: QMessageLogContext, text: str) -> None:
    """Prints Qt's messages to standard error; a fatal one ends the program with one line, not an abort."""
    if kind is QtMsgType.QtFatalMsg:
        error = UserError(f"Qt can't show a window: {text}", "Check DISPLAY and Qt's libraries")
        print(f"error: {error}", file=sys.stderr, flush=True)
        os._exit(int(ExitCode.FAILED))
    if kind in (QtMsgType.QtCriticalMsg, QtMsgType.QtSystemMsg):
        print(f"Qt: {text}", file=sys.stderr)
