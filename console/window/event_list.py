"""List of events, newest first."""

from datetime import datetime
from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QListWidget, QListWidgetItem

from console.monitor.event_filter import EventFilter
from console.monitor.event_log import CAPACITY, EventLine, EventLog
from console.presentation.severity_style import SeverityStyle
from console.window.labels import plain_tip

_TIME_OF_DAY: Final = "%H:%M:%S"
_DATE_AND_ZONE: Final = "%Y-%m-%d %H:%M:%S %Z"


class EventList(QListWidget):
    """Grows at the top; keeps the operator's scroll position."""

    def __init__(self) -> None:
        super().__init__()
        self._shown = 0
        self._filter = EventFilter()
        self._log = EventLog()
        self.setWordWrap(True)
        self.setAccessibleName("Events")
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setVerticalScrollMode(QListWidget.ScrollMode.ScrollPerPixel)
        self.setMinimumHeight(3 * self.fontMetrics().lineSpacing())

    @property
    def lines(self) -> list[str]:
        """The listed texts, newest first."""
        return [self.item(row).text() for row in range(self.count()) if not self.isRowHidden(row)]

    @property
    def listed(self) -> list[EventLine]:
        """The listed events, oldest first."""
        return [event for event in self._log.lines if self._filter.lists(event)]

    def set_filter(self, chosen: EventFilter) -> None:
        """Lists only the events of this filter."""
        self._filter = chosen
        for row, event in enumerate(reversed(self._log.lines)):
            self.setRowHidden(row, not chosen.lists(event))

    def show_log(self, log: EventLog) -> None:
        """Adds the lines that are not shown yet."""
        for event in log.since(self._shown):
            self.insertItem(0, _item(event))
            self.setRowHidden(0, not self._filter.lists(event))
        self._shown, self._log = log.count, log
        while self.count() > CAPACITY:
            self.takeItem(self.count() - 1)


def _item(event: EventLine) -> QListWidgetItem:
    item = QListWidgetItem(f"{_clock(event.at_s, _TIME_OF_DAY)}  {event.text}")
    item.setToolTip(plain_tip(_clock(event.at_s, _DATE_AND_ZONE)))
    font = item.font()
    font.setItalic(event.own)
    font.setBold(event.style in (SeverityStyle.WARNING, SeverityStyle.BAD))
    item.setFont(font)
    return item


def _clock(at_s: float, form: str) -> str:
    """Returns this computer's time; dashes for a time beyond the calendar, which a robot may well send."""
    try:
        return datetime.fromtimestamp(at_s).astimezone().strftime(form)
    except (ValueError, OverflowError, OSError):
        return "--:--:--"
