"""Qt without a screen: one application for all tests of a run, waiting in its event loop, screenshots."""

import os
import platform
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final, TypeVar

import pytest

# Read when the first application is made.
os.environ.setdefault("QT_QPA_PLATFORM", f"offscreen:configfile={Path(__file__).with_name('offscreen.json')}")

from PySide6.QtCore import QCoreApplication, QEventLoop, QSettings, Qt, QTimer
from PySide6.QtGui import QColor, QImage, QPalette
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget

T = TypeVar("T")
KEPT_IN = Path(__file__).parents[2] / "artifacts" / "monitor"
"""Screenshots of windows; git does not look there."""
_FOR_THE_DOCUMENTS: Final = "SCREENSHOTS_FOR_DOCUMENTS"
"""Environment variable: set where screenshots for docs/images are taken."""
_LAID_OUT_AFTER_S = 0.3
"""Texts that have just changed have found their place."""
_TURNS: Final = 5
"""Of the event loop: one event has another one sent."""
LIGHT, DARK = QColor("#efefef"), QColor("#2d2d30")


@pytest.fixture(scope="session")
def application() -> QApplication:
    """One for all: Qt allows no second one."""
    app = QApplication.instance() or QApplication(["tests"])
    assert isinstance(app, QApplication)
    app.setStyle("Fusion")
    # Windows come and go; the loop of the tests goes on.
    app.setQuitOnLastWindowClosed(False)
    return app


@pytest.fixture
def own_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A directory of the test's own for settings and pictures."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    # GStreamer's registry stays where it is: without it each program examines all plugins anew.
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    monkeypatch.setenv("GST_REGISTRY", str(cache / f"gstreamer-1.0/registry.{platform.machine()}.bin"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    QSettings.setPath(QSettings.Format.IniFormat, QSettings.Scope.UserScope, str(tmp_path))
    return tmp_path


def let_pass(seconds: float) -> None:
    """The event loop runs for so long, as it does under a person's eyes; other threads run, too."""
    loop = QEventLoop()
    QTimer.singleShot(round(seconds * 1000), loop.quit)
    loop.exec()
    # After a stall the time has passed before what has come meanwhile was looked at.
    for _ in range(_TURNS):
        QCoreApplication.processEvents()


def until(condition: Callable[[], T | None], what: str, within_s: float = 20.0) -> T:
    """Runs the event loop until the condition is true, and gives what it gave; fails after `within_s`."""
    deadline_s = time.monotonic() + within_s
    while not (answer := condition()):
        assert time.monotonic() < deadline_s, f"not within {within_s:g} s: {what}"
        let_pass(0.01)
    return answer


def pixel_rows(image: QImage) -> Iterator[Iterator[tuple[int, int, int]]]:
    """Yields the rows of an image: red, green and blue of each pixel, ten times as fast as `pixelColor`."""
    rgb = image.convertToFormat(QImage.Format.Format_RGB888)
    data, stride, length = bytes(rgb.constBits()), rgb.bytesPerLine(), 3 * rgb.width()
    for first in range(0, stride * rgb.height(), stride):
        row = data[first : first + length]
        yield zip(row[::3], row[1::3], row[2::3], strict=True)


def press(
    widget: QWidget, key: Qt.Key, modifier: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier
) -> None:
    """Presses a key in the active window; a shortcut of a window that is not active yet would be lost."""
    window = widget.window()
    window.activateWindow()
    until(window.isActiveWindow, "the window is active")
    QTest.keyClick(widget, key, *modifier)


def keep_screenshot(
    widget: QWidget,
    name: str,
    *,
    fills_in_s: float = 0.0,
    at_last: Callable[[], object] = lambda: None,
) -> Path:
    """A screenshot, as an artefact; in lossless PNG.

    Args:
        widget: what is shown.
        name: of the file.
        fills_in_s: time until plots and texts are worth a picture in the documents.
        at_last: returns when what must be seen is there; the picture is taken at that moment.
    """
    if os.environ.get(_FOR_THE_DOCUMENTS):
        let_pass(fills_in_s)
    KEPT_IN.mkdir(parents=True, exist_ok=True)
    file = KEPT_IN / f"{name}.png"
    let_pass(_LAID_OUT_AFTER_S)
    at_last()
    # Qt's 0 is the smallest file, without any loss.
    assert widget.grab().save(str(file), "PNG", 0), f"{file} can't be written"
    return file


def in_colours(ground: QColor) -> None:
    """The desktop turns light or dark."""
    QApplication.setPalette(QPalette(ground))
