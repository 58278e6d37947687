"""The top of the window: who the robot is, how it is, and whether it answers; a banner when it does not."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QLabel, QPushButton, QVBoxLayout, QWidget

from console.client.results import HealthState
from console.monitor.link import LinkWords
from console.monitor.state import MonitorState
from console.tone import Tone
from console.window.labels import ElidedLabel, WrappedLabel, scale_font, set_bold, set_text, word_label
from console.window.lines import TintedLine
from console.window.look import DimLabel, Marker
from console.words import UNKNOWN, joined

_HEALTH = {HealthState.OK: Tone.GOOD, HealthState.DEGRADED: Tone.WARNING, HealthState.UNKNOWN: Tone.QUIET}


class Header(QWidget):
    """The robot's name and health on the left, the connection on the right.

    Args:
        target: the robot's address.
    """

    def __init__(self, target: str) -> None:
        super().__init__()
        self.name, self.target = word_label("robot"), DimLabel(target)
        self.health, self.link = MarkedWord(), MarkedWord(word_label())
        set_bold(self.name, True)
        scale_font(self.name, 1.4)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(10)
        for widget in (self.name, self.target):
            layout.addWidget(widget)
        layout.addSpacing(12)
        layout.addWidget(self.health, 1)
        layout.addWidget(self.link)

    def show_state(self, state: MonitorState, words: LinkWords, now_s: float) -> None:
        """Shows the newest."""
        self.link.show_word(words.tone, words.mark, words.detail)
        if state.snapshot is None:
            self.health.show_word(Tone.QUIET, "not known", "")
            return
        status = state.snapshot.status
        set_text(self.name, status.gateway_name or "robot")
        self.target.setToolTip(f"Gateway {status.gateway_version or UNKNOWN}")
        if state.outdated(now_s):
            last = joined(f"last heard: {status.health.state.value.upper()}", status.health.summary)
            self.health.show_word(Tone.QUIET, "not known", last)
        else:
            health = status.health
            self.health.show_word(_HEALTH[health.state], health.state.value.upper(), health.summary)


class MarkedWord(QWidget):
    """A marker, a word in bold, and what goes with it.

    Args:
        detail: takes that; by default a label that gives way where there is little room.
    """

    def __init__(self, detail: QLabel | None = None) -> None:
        super().__init__()
        self.marker, self.word, self.detail = Marker(), word_label(), detail or ElidedLabel()
        set_bold(self.word, True)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.marker)
        layout.addWidget(self.word)
        layout.addWidget(self.detail, 1)

    def show_word(self, tone: Tone, word: str, detail: str) -> None:
        """Changes all three."""
        self.marker.show_tone(tone)
        set_text(self.word, word)
        set_text(self.detail, detail)
        self.setAccessibleName(joined(word, detail))


class Banner(TintedLine):
    """Says why the robot does not answer and what to do; hidden while it does."""

    retry = Signal()
    """The operator does not want to wait for the next attempt."""

    def __init__(self) -> None:
        super().__init__()
        self.text, self.next_try = WrappedLabel(), DimLabel()
        self.button = QPushButton("&Retry now")
        self.button.clicked.connect(self.retry)
        words = QVBoxLayout()
        words.addWidget(self.text)
        words.addWidget(self.next_try)
        self.grid.addLayout(words, 0, 1)
        self.grid.addWidget(self.button, 0, 2)
        self.grid.setColumnStretch(1, 1)
        self.setVisible(False)

    def show_words(self, words: LinkWords) -> None:
        """Shows the newest."""
        self.setVisible(bool(words.banner))
        if words.banner:
            self.show_tone(words.tone)
            set_text(self.text, words.banner)
            set_text(self.next_try, words.retry)
