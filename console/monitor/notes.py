"""Answers for the operator, on their way from the worker's loop to the window."""

from collections import deque
from collections.abc import Callable
from typing import Final

from console.presentation.preview_switch import Note
from console.presentation.severity_style import SeverityStyle

_MOST: Final = 8


class Notes:
    """The newest notes that were not taken yet. One thread adds, another one takes.

    Args:
        on_change: called after each note; must only hand over.
    """

    def __init__(self, on_change: Callable[[], None]) -> None:
        self._on_change = on_change
        self._notes: deque[Note] = deque(maxlen=_MOST)

    def add(self, text: str, style: SeverityStyle) -> None:
        """Adds one; the oldest gives way."""
        self._notes.append(Note(text, style))
        self._on_change()

    def take(self) -> list[Note]:
        """Returns those that were not taken yet."""
        notes = []
        while self._notes:
            notes.append(self._notes.popleft())
        return notes
