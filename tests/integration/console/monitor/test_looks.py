"""Readable in light and dark, distinguishable without colours, as large as a small laptop's screen allows."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import pytest
from PySide6.QtCore import QRectF
from PySide6.QtGui import QColor, QImage, QPainter, QPalette
from PySide6.QtWidgets import QAbstractButton, QApplication, QLabel, QPushButton, QWidget

from console.presentation.severity_style import SeverityStyle
from console.window.cell import SmallLabel
from console.window.labels import ElidedLabel, WrappedLabel
from console.window.lines import TintedLine
from console.window.monitor_window import MonitorWindow
from console.window.programs import monitor
from console.window.theme import draw_shape
from tests.support.gateway_double import GatewayDouble, serving
from tests.support.qt import DARK, LIGHT, in_colours, keep_screenshot, let_pass, until
from tests.support.snapshots import event

READABLE = 4.5
"""Contrast that the Web Content Accessibility Guidelines ask of text (level AA)."""
DISABLED_READABLE = 3.0
"""They ask nothing of what is disabled; this much of signs that are not text."""
SMALL_SCREEN = (1024, 600)
SETTINGS = "robot-gateway/monitor.ini"


def troubled() -> GatewayDouble:
    """Something of every style."""
    made = GatewayDouble()
    made.status.vision.stale, made.status.vision.age_ms = True, 3400
    made.status.faults.add(
        id="a", severity=3, component="odometry", message="stopped", remedy="Look", active=True, age_ms=2000
    )
    made.status.faults.add(
        id="b", severity=2, component="disk", message="nearly full", active=True, age_ms=2000
    )
    made.status.faults.add(id="c", component="battery", message="low", active=False, cleared_age_ms=5000)
    made.status.preview.last_error = "the camera was busy"
    made.overlay.events.append(event(1, "preview running, balanced"))
    return made


@pytest.fixture
def window() -> Iterator[MonitorWindow]:
    with serving(troubled()) as port, monitor(f"127.0.0.1:{port}") as made:
        until(lambda: len(made.side.faults.shown) == 3, "everything is shown")
        yield made


def brightness(colour: QColor) -> float:
    """Relative luminance, as WCAG defines it."""
    parts = [colour.redF(), colour.greenF(), colour.blueF()]
    red, green, blue = (p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(one: QColor, other: QColor) -> float:
    light, dark = sorted((brightness(one), brightness(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def ground_of(widget: QWidget) -> QColor:
    """What is behind a label: its tinted line, or the window."""
    parent = widget.parentWidget()
    while parent and not isinstance(parent, TintedLine):
        parent = parent.parentWidget()
    return (parent or widget).palette().color(QPalette.ColorRole.Window)


@pytest.mark.parametrize(("name", "ground"), [("light", LIGHT), ("dark", DARK)])
def test_every_text_is_readable(window: MonitorWindow, name: str, ground: QColor) -> None:
    in_colours(ground)
    let_pass(0.3)
    keep_screenshot(window, f"colours-{name}")
    labels = [each for each in window.findChildren(QLabel) if each.text() and each.isVisible()]
    assert len(labels) > 30
    for label in labels:
        ratio = contrast(label.palette().color(label.foregroundRole()), ground_of(label))
        assert ratio >= READABLE, f"'{label.text()}' on {ground_of(label).name()}: {ratio:.1f}"


@pytest.mark.parametrize("ground", [LIGHT, DARK], ids=["light", "dark"])
def test_a_button_that_is_disabled_can_still_be_read(window: MonitorWindow, ground: QColor) -> None:
    in_colours(ground)
    let_pass(0.3)
    active, disabled = QPalette.ColorGroup.Active, QPalette.ColorGroup.Disabled
    text, ground_role = QPalette.ColorRole.ButtonText, QPalette.ColorRole.Button
    # STOP has colours of its own, and is never disabled.
    buttons = [each for each in window.findChildren(QAbstractButton) if each.text() not in ("", "STOP")]
    assert len(buttons) > 15
    for button in buttons:
        palette = button.palette()
        ratio = contrast(palette.color(disabled, text), palette.color(disabled, ground_role))
        assert ratio >= DISABLED_READABLE, f"'{button.text()}': {ratio:.1f}"
        enabled = contrast(palette.color(active, text), palette.color(active, ground_role))
        assert ratio < enabled, f"'{button.text()}' looks as if it could be pressed"


def test_the_banner_of_a_lost_connection_is_readable() -> None:
    with monitor("127.0.0.1:9") as window:
        until(window.banner.isVisible, "the banner")
        let_pass(0.3)
        for label in (window.banner.text, window.banner.next_try):
            ratio = contrast(label.palette().color(label.foregroundRole()), ground_of(label))
            assert ratio >= READABLE, f"{label.text()}: {ratio:.1f}"


def test_a_desktop_that_turns_dark_takes_the_window_along(window: MonitorWindow) -> None:
    line = window.side.faults.shown[0]
    assert isinstance(line, TintedLine)
    bright = brightness(line.palette().color(QPalette.ColorRole.Window))
    in_colours(DARK)
    until(lambda: brightness(line.palette().color(QPalette.ColorRole.Window)) < bright / 4, "a dark line")


def drawn(style: SeverityStyle) -> QImage:
    image = QImage(32, 32, QImage.Format.Format_RGB32)
    image.fill(LIGHT)
    painter = QPainter(image)
    draw_shape(painter, QRectF(2, 2, 28, 28), style, QApplication.palette())
    painter.end()
    return image.convertToFormat(QImage.Format.Format_Grayscale8)


@pytest.mark.parametrize(("one", "other"), list(combinations(SeverityStyle, 2)))
def test_shapes_differ_without_any_colour(one: SeverityStyle, other: SeverityStyle) -> None:
    first, second = drawn(one), drawn(other)
    differing = sum(
        abs(QColor(first.pixel(x, y)).red() - QColor(second.pixel(x, y)).red()) > 60
        for x in range(32)
        for y in range(32)
    )
    assert differing > 90, f"only {differing} of 1024 pixels differ between {one} and {other}"


def test_it_fits_a_small_screen_and_nothing_is_cut_off(window: MonitorWindow) -> None:
    smallest = window.minimumSizeHint()
    assert smallest.width() <= SMALL_SCREEN[0]
    assert smallest.height() <= SMALL_SCREEN[1]
    window.resize(smallest)
    let_pass(0.3)
    keep_screenshot(window, "smallest")
    words: list[QPushButton | QLabel] = [*window.findChildren(QPushButton), *window.findChildren(QLabel)]
    for word in words:
        gives_way = isinstance(word, ElidedLabel | SmallLabel | WrappedLabel)
        if word.isVisible() and word.text() and not gives_way:
            assert word.width() >= word.sizeHint().width(), f"'{word.text()}' is cut off"


@dataclass(frozen=True)
class Left:
    """How a window was left."""

    size: tuple[int, int]
    maximised: bool
    panel: bool
    sound: bool


def open_and_close(change: tuple[int, int] | None = None) -> Left:
    with monitor("127.0.0.1:9") as window:
        let_pass(0.1)
        if change:
            window.showNormal()
            window.resize(*change)
            window.arrangement.toggle_panel()
            window.toggle_sound()
            let_pass(0.1)
        size = (window.width(), window.height())
        return Left(size, window.isMaximized(), window.side.isVisible(), window.alarm.sound_on)


def test_it_opens_as_it_was_left() -> None:
    left = open_and_close((1400, 900))
    assert left == Left((1400, 900), maximised=False, panel=False, sound=True)
    assert open_and_close() == left


FIRST = Left((1920, 1080), maximised=True, panel=True, sound=False)


def test_the_first_time_it_is_maximised_with_its_panel_and_without_sound() -> None:
    assert open_and_close() == FIRST


@pytest.mark.parametrize(
    "content",
    [
        b"\xff\xfe\x00nonsense[[[",
        b"[window]\ngeometry=@ByteArray(xyz)\npanel=perhaps\n",
        b"[window]\ngeometry=7\npanel=@Variant(\\0\\0\\0\\x7f)\n",
        b"",
    ],
)
def test_a_broken_settings_file_is_ignored(own_settings: Path, content: bytes) -> None:
    file = own_settings / SETTINGS
    file.parent.mkdir(parents=True)
    file.write_bytes(content)
    assert open_and_close() == FIRST
    assert open_and_close((1300, 850)) == open_and_close(), "it is mended by the next good one"


def test_a_settings_file_that_can_not_be_written_is_ignored(own_settings: Path) -> None:
    file = own_settings / SETTINGS
    file.mkdir(parents=True)
    assert open_and_close() == FIRST
