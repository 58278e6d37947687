"""The log of events, newest first."""

from datetime import datetime
from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QListWidget, QListWidgetItem

from console.client import OverlaySnapshot
from console.monitor.event_log import EventLog

KEPT: Final = 200
"""Older lines go."""
_LINES_SHOWN = 7


class EventList(QListWidget):
    """Grows at the top; stays where the operator has scrolled to."""

    def __init__(self) -> None:
        super().__init__()
        self._log = EventLog()
        self.setWordWrap(True)
        self.setAccessibleName("Events")
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setVerticalScrollMode(QListWidget.ScrollMode.ScrollPerPixel)
        self.setMinimumHeight(3 * self.fontMetrics().lineSpacing())
        self.setMaximumHeight((_LINES_SHOWN + 1) * self.fontMetrics().lineSpacing())

    @property
    def lines(self) -> list[str]:
        """What is listed, newest first."""
        return [self.item(row).text() for row in range(self.count())]

    def add(self, snapshot: OverlaySnapshot) -> None:
        """Adds what is new in the snapshot."""
        for event in self._log.news(snapshot):
            at = datetime.fromtimestamp(event.at_s).astimezone().strftime("%H:%M:%S")
            item = QListWidgetItem(f"{at}  {event.message}")
            if event.own:
                font = item.font()
                font.setItalic(True)
                item.setFont(font)
            self.insertItem(0, item)
        while self.count() > KEPT:
            self.takeItem(self.count() - 1)
