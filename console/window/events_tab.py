"""Tab of the events: severity, search, export, and the list."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QCheckBox, QComboBox, QHBoxLayout, QLineEdit, QPushButton, QVBoxLayout, QWidget

from console.monitor.event_filter import AtLeast, EventFilter
from console.window.event_list import EventList
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
        row = fill(QHBoxLayout(), (self.severity, 1), self.export, spacing=4)
        parts = (row, self.search, self.presence, (self.list, 1))
        fill(QVBoxLayout(self), *parts, spacing=4, margins=(4, 4, 4, 4))

    def _filter(self) -> None:
        presence = self.presence.isChecked()
        self.list.set_filter(EventFilter(self.severity.currentData(), self.search.text(), presence))
