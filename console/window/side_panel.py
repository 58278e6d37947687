"""Side panel: faults with remedies, status by component, events."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QLabel, QScrollArea, QVBoxLayout, QWidget

from console.monitor.monitor_state import MonitorState
from console.monitor.status_rows import component_rows, fault_rows
from console.presentation.formatting import age
from console.presentation.severity_style import SeverityStyle
from console.presentation.status_table import Row
from console.window.event_list import EventList
from console.window.labels import set_bold, set_text
from console.window.layout import fill
from console.window.lines import LineList, StatusLine

_MIN_WIDTH_CHARS = 34
_NO_FAULT = Row("", "none", SeverityStyle.GOOD, "The robot reports no fault")
_NO_STATUS = Row("", "", SeverityStyle.QUIET, "No status received yet")


class SidePanel(QWidget):
    """The robot's status as text."""

    def __init__(self) -> None:
        super().__init__()
        self.faults_title, self.status_title = _heading("Faults"), _heading("Status")
        self.faults = LineList(lambda: StatusLine("", "warning", bold=True))
        self.components = LineList(lambda: StatusLine("Computer battery", "no data"))
        self.events = EventList()
        fill(QVBoxLayout(self), (self._scrolled(), 4), _heading("Events"), (self.events, 1))

    def show_state(self, state: MonitorState, now_s: float) -> None:
        """Shows the latest state."""
        none = _NO_STATUS if state.snapshot is None else _NO_FAULT
        self.faults.show_items(fault_rows(state, now_s) or [none])
        self.components.show_items(component_rows(state, now_s))
        received = ""
        if state.snapshot and state.outdated(now_s):
            received = f", as of {age(state.snapshot_age_ms(now_s))} ago"
        set_text(self.faults_title, f"Faults{received}")
        set_text(self.status_title, f"Status{received}")
        self.events.show_log(state.events)

    def _scrolled(self) -> QScrollArea:
        inner = QWidget()
        parts = (self.faults_title, self.faults, self.status_title, self.components)
        fill(QVBoxLayout(inner), *parts, margins=(0, 0, 4, 0)).addStretch(1)
        scroll = QScrollArea()
        scroll.setWidget(inner)
        scroll.setWidgetResizable(True)
        scroll.setFrameShape(QFrame.Shape.NoFrame)
        scroll.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        scroll.setAccessibleName("Faults and status")
        scroll.setMinimumWidth(_MIN_WIDTH_CHARS * self.fontMetrics().horizontalAdvance("m"))
        return scroll


def _heading(text: str) -> QLabel:
    label = QLabel(text)
    set_bold(label, True)
    return label
