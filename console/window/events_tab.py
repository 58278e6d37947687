"""Tab of the events: severity, search, export, and the list."""

from datetime import datetime

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QCheckBox, QComboBox, QHBoxLayout, QLineEdit, QPushButton, QVBoxLayout, QWidget

from console.monitor.event_filter import AtLeast, EventFilter
from console.monitor.event_log import EventLog
from console.presentation.formatting import zone_text
from console.window.cell import SmallLabel
from console.window.event_list import EventList
from console.window.labels import set_text
from console.window.layout import fill


class EventsTab(QWidget):
    """Filters the list; the export takes what is listed."""

    export_asked = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.list = EventList()
        self.severity, self.search = QComboBox(), QLineEdit()
        for choice in AtLeast:
            self.severity.addItem(choice.value, choice)
        self.severity.setAccessibleName("Severity of the listed events")
        self.search.setPlaceholderText("Search (Ctrl+F)")
        self.search.setAccessibleName("Words that a listed event must have")
        self.search.setClearButtonEnabled(True)
        self.export = QPushButton("&Export")
        self.export.setToolTip("Saves the listed events as JSON lines (Ctrl+E)")
        self.presence = QCheckBox("&Who joins and leaves")
        self.presence.setAccessibleName("List who joins and leaves")
        self.severity.currentIndexChanged.connect(self._filter)
        self.search.textChanged.connect(self._filter)
        self.presence.toggled.connect(self._filter)
        self.export.clicked.connect(self.export_asked)
        self.zone = SmallLabel()
        self.zone.setToolTip("The zone of this computer, in which the list has its times")
        row = fill(QHBoxLayout(), (self.severity, 1), self.export, spacing=4)
        above = fill(QHBoxLayout(), self.presence, (self.zone, 1), spacing=8)
        parts = (row, self.search, above, (self.list, 1))
        fill(QVBoxLayout(self), *parts, spacing=4, margins=(4, 4, 4, 4))

    def show_log(self, log: EventLog) -> None:
        """Lists the events that are not listed yet, and names the zone of their times, which may change."""
        self.list.show_log(log)
        set_text(self.zone, f"Times: {zone_text(datetime.now().astimezone())}")

    def _filter(self) -> None:
        presence = self.presence.isChecked()
        self.list.set_filter(EventFilter(self.severity.currentData(), self.search.text(), presence))
