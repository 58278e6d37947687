"""A marker, a word in bold, and its detail, on one line."""

from PySide6.QtWidgets import QHBoxLayout, QWidget

from console.presentation.formatting import joined
from console.presentation.severity_style import SeverityStyle
from console.window.labels import ElidedLabel, PlainLabel, set_bold, set_text
from console.window.layout import fill
from console.window.theme import Marker


class MarkedWord(QWidget):
    """Shows a state; the detail is elided where there is little room."""

    def __init__(self) -> None:
        super().__init__()
        self.marker, self.word, self.detail = Marker(), PlainLabel(), ElidedLabel()
        set_bold(self.word, True)
        fill(QHBoxLayout(self), self.marker, self.word, (self.detail, 1), spacing=6)

    def show_word(self, style: SeverityStyle, word: str, detail: str) -> None:
        """Changes all three."""
        self.marker.show_style(style)
        set_text(self.word, word)
        set_text(self.detail, detail)
        self.setAccessibleName(joined(word, detail))
