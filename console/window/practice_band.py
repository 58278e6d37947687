"""The band at the top of the practice window: no robot moves, and the choice of the network."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QColor, QPalette
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QVBoxLayout, QWidget

from console.window.labels import ElidedLabel, PlainLabel, scale_font, set_bold, set_text
from console.window.layout import fill

_GROUND: Final = QColor("#CC79A7")
"""Reddish purple of Okabe and Ito: nothing else in the window has this colour."""
_INK: Final = QColor("#000000")
_WORD_FACTOR: Final = 1.6


class PracticeBand(QWidget):
    """Always visible in the practice window, and in no other: no status of a robot brings it forth.

    Args:
        networks: title and lesson of each, the first one chosen.
    """

    chosen = Signal(int)
    """With the number of the network in the order given."""

    def __init__(self, networks: Sequence[tuple[str, str]]) -> None:
        super().__init__()
        self._lessons = [lesson for _, lesson in networks]
        self.word, self.networks, self.lesson = PlainLabel("PRACTICE"), QComboBox(), ElidedLabel()
        self.networks.addItems([title for title, _ in networks])
        self.networks.currentIndexChanged.connect(self._choose)
        # The keys belong to the driver's hands.
        self.networks.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.networks.setAccessibleName("Network")
        self._lay_out()
        set_text(self.lesson, self._lessons[0])

    def choose_next(self) -> None:
        """Chooses the next network; after the last one the first."""
        self.networks.setCurrentIndex((self.networks.currentIndex() + 1) % len(self._lessons))

    def _choose(self, number: int) -> None:
        set_text(self.lesson, self._lessons[number])
        self.chosen.emit(number)

    def _lay_out(self) -> None:
        palette = QPalette(_GROUND)
        palette.setColor(QPalette.ColorRole.WindowText, _INK)
        self.setPalette(palette)
        self.setAutoFillBackground(True)
        set_bold(self.word, True)
        scale_font(self.word, _WORD_FACTOR)
        no_robot = PlainLabel("No robot moves: everything happens on this computer.")
        set_bold(no_robot, True)
        texts = fill(QVBoxLayout(), no_robot, self.lesson, spacing=0)
        row = fill(QHBoxLayout(self), self.word, spacing=16, margins=(10, 4, 10, 4))
        row.addLayout(texts, 1)
        fill(row, PlainLabel("Network (key N):"), self.networks, spacing=16, margins=(10, 4, 10, 4))
        self.setAccessibleName("Practice: no robot moves")
