"""Notes that appear over the picture for a while, so that nothing beside it moves."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QVBoxLayout, QWidget

from console.presentation.preview_switch import Note
from console.window.layout import fill
from console.window.lines import LineList, NoteLine

_SHOWN_MS: Final = 6000
_MOST: Final = 4
"""Of the passing notes; older ones give way."""


class Toasts(QWidget):
    """Shows the answers to the operator's requests as long as they hold, and other notes for six seconds."""

    def __init__(self) -> None:
        super().__init__()
        self.setAccessibleName("Messages")
        self.lines = LineList(NoteLine)
        self._answers: tuple[Note, ...] = ()
        self._passing: tuple[Note, ...] = ()
        self._timer = QTimer(self, interval=_SHOWN_MS, singleShot=True)
        self._timer.timeout.connect(self.dismiss)
        fill(QVBoxLayout(self), self.lines)
        self.setVisible(False)

    @property
    def notes(self) -> Sequence[Note]:
        """What is shown."""
        return (*self._answers, *self._passing)

    def height_for(self, width: int) -> int:
        """Returns the height of all notes at a width."""
        return self.lines.heightForWidth(width)

    def show_answers(self, answers: tuple[Note, ...]) -> None:
        """Shows exactly these answers."""
        if answers != self._answers:
            self._answers = answers
            self._show()

    def show_passing(self, note: Note) -> None:
        """Shows a note for a while."""
        self._passing = (*self._passing, note)[-_MOST:]
        self._timer.start()
        self._show()

    def dismiss(self) -> None:
        """Takes the passing notes away."""
        self._passing = ()
        self._show()

    def _show(self) -> None:
        self.lines.show_items(self.notes)
        self.setVisible(bool(self.notes))
