"""Header of the window: the robot's name and health, and the connection; a banner while it is lost."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QLabel, QPushButton, QVBoxLayout, QWidget

from console.monitor.link import LinkText
from console.monitor.monitor_state import MonitorState
from console.presentation.formatting import UNKNOWN, joined
from console.presentation.severity_style import HEALTH_STYLES, SeverityStyle
from console.presentation.status_table import health_summary
from console.window.labels import (
    ElidedLabel,
    PlainLabel,
    WrappedLabel,
    scale_font,
    set_bold,
    set_text,
    set_tool_tip,
)
from console.window.layout import fill
from console.window.lines import TintedLine
from console.window.theme import DimLabel, Marker


class Header(QWidget):
    """The robot's name and health on the left, the connection on the right.

    Args:
        target: the robot's address.
    """

    def __init__(self, target: str) -> None:
        super().__init__()
        self.name, self.target = PlainLabel("robot"), DimLabel(target)
        self.health, self.link = MarkedWord(), MarkedWord(PlainLabel())
        set_bold(self.name, True)
        scale_font(self.name, 1.4)
        fill(QHBoxLayout(self), self.name, self.target, 12, (self.health, 1), self.link, spacing=10)

    def show_state(self, state: MonitorState, link: LinkText, now_s: float) -> None:
        """Shows the latest state."""
        self.link.show_word(link.style, link.mark, link.detail)
        if state.snapshot is None:
            self.health.show_word(SeverityStyle.QUIET, "not known", "")
            return
        status, health = state.snapshot.status, state.snapshot.status.health
        summary = health_summary(status)
        set_text(self.name, status.gateway_name or "robot")
        set_tool_tip(self.target, f"Gateway {status.gateway_version or UNKNOWN}")
        if state.outdated(now_s):
            last = joined(f"last known: {health.state.value.upper()}", summary)
            self.health.show_word(SeverityStyle.QUIET, "not known", last)
        else:
            self.health.show_word(HEALTH_STYLES[health.state], health.state.value.upper(), summary)


class MarkedWord(QWidget):
    """A marker, a word in bold, and its detail.

    Args:
        detail: label of the detail; by default one that is elided where there is little room.
    """

    def __init__(self, detail: QLabel | None = None) -> None:
        super().__init__()
        self.marker, self.word, self.detail = Marker(), PlainLabel(), detail or ElidedLabel()
        set_bold(self.word, True)
        fill(QHBoxLayout(self), self.marker, self.word, (self.detail, 1))

    def show_word(self, style: SeverityStyle, word: str, detail: str) -> None:
        """Changes all three."""
        self.marker.show_style(style)
        set_text(self.word, word)
        set_text(self.detail, detail)
        self.setAccessibleName(joined(word, detail))


class ConnectionBanner(TintedLine):
    """The connection's error and its remedy; hidden while connected."""

    retry = Signal()
    """The button "Retry now" was pressed."""

    def __init__(self) -> None:
        super().__init__()
        self.text, self.next_try = WrappedLabel(), DimLabel()
        self.button = QPushButton("&Retry now")
        self.button.clicked.connect(self.retry)
        self.grid.addLayout(fill(QVBoxLayout(), self.text, self.next_try), 0, 1)
        self.grid.addWidget(self.button, 0, 2)
        self.grid.setColumnStretch(1, 1)
        self.setVisible(False)

    def show_item(self, item: LinkText) -> None:
        """Shows the latest text."""
        self.setVisible(bool(item.banner))
        if item.banner:
            self.show_style(item.style)
            set_text(self.text, item.banner)
            set_text(self.next_try, item.retry)
