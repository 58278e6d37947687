"""Side panel: active faults, and below them tabs: status, events, recordings, in a narrow window plots."""

from typing import Final

from PySide6.QtCore import QEvent, Qt, Signal
from PySide6.QtWidgets import (
    QBoxLayout,
    QFrame,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QScrollArea,
    QSizePolicy,
    QTabWidget,
    QVBoxLayout,
    QWidget,
)

from console.monitor.alarm import Alarm
from console.monitor.monitor_state import MonitorState
from console.monitor.preview_controls import Controls
from console.monitor.status_rows import component_rows, fault_items, stream_rows
from console.presentation.formatting import age
from console.presentation.own_stream import OwnStream
from console.window.events_tab import EventsTab
from console.window.fault_line import FaultLine
from console.window.labels import set_bold, set_text
from console.window.layout import fill
from console.window.lines import LineList, NoteLine, StatusLine
from console.window.plot import Plots
from console.window.recordings_tab import RecordingsTab
from console.window.theme import PALETTE_CHANGES, with_readable_disabled

WIDTH_PX: Final = 300
TABS: Final = ("Status", "Events", "Plots", "Recordings")
_LEAST_FAULTS_PX: Final = 72
_FAULTS_SHARE: Final = 1, 4
"""Heights of faults and tabs: fixed, so that a new fault does not move what is below."""


class SidePanel(QWidget):
    """The robot's status as text."""

    acknowledged = Signal(object)
    """A fault's button was pressed; with its FaultItem."""

    def __init__(self) -> None:
        super().__init__()
        self.setFixedWidth(WIDTH_PX)
        self.faults_title = QLabel("Faults")
        self.faults_title.setTextFormat(Qt.TextFormat.PlainText)
        set_bold(self.faults_title, True)
        self.acknowledge = QPushButton("Acknowledge &all")
        self.acknowledge.setToolTip("Mutes the alarm for what is wrong now (A)")
        self.sound = QPushButton("Sound")
        self.sound.setCheckable(True)
        self.sound.setToolTip("Alarm sound on or off (M)")
        self.faults, self.notes = LineList(self._fault_line), LineList(NoteLine)
        self.components = LineList(StatusLine)
        self.events_tab = EventsTab()
        self.events = self.events_tab.list
        self.plots = Plots(QBoxLayout.Direction.TopToBottom)
        self.recordings = RecordingsTab()
        self.tabs = QTabWidget()
        self._lay_out()
        self._colour_disabled()

    def show_state(
        self,
        state: MonitorState,
        controls: Controls,
        alarm: Alarm,
        now_s: float,
        stream: OwnStream | None = None,
    ) -> None:
        """Shows the latest state.

        Args:
            state: of robot and connection.
            controls: of the preview.
            alarm: of the faults and the connection.
            now_s: on the monotonic clock.
            stream: how the pictures of this window come; None before they do.
        """
        self.faults.show_items(fault_items(state, alarm, now_s))
        self.notes.show_items(controls.beside_faults)
        self.components.show_items([*component_rows(state, now_s), *stream_rows(stream)])
        outdated = state.snapshot is not None and state.outdated(now_s)
        received = f"as of {age(state.snapshot_age_ms(now_s))} ago" if outdated else ""
        set_text(self.faults_title, f"Faults, {received}" if received else "Faults")
        self.acknowledge.setEnabled(alarm.pending > 0)
        self.sound.setChecked(alarm.sound_on)
        set_text(self.sound, "Sound on" if alarm.sound_on else "Sound off")
        self.events_tab.show_log(state.events)

    def show_tab(self, number: int) -> None:
        """Shows a tab, by its number from 0, and gives it the focus."""
        if self.tabs.isTabVisible(number):
            self.tabs.setCurrentIndex(number)
            self.tabs.tabBar().setFocus()

    def show_plots_tab(self, shown: bool) -> None:
        """Shows or hides the tab of the plots."""
        self.tabs.setTabVisible(self.tabs.indexOf(self.plots), shown)

    def show_recordings_tab(self, shown: bool) -> None:
        """Shows or hides the tab of the recordings."""
        number = TABS.index("Recordings")
        if self.tabs.isTabVisible(number) != shown:
            self.tabs.setTabVisible(number, shown)

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802 - Qt's name
        """Follows the desktop from light to dark."""
        super().changeEvent(event)
        if event.type() in PALETTE_CHANGES:
            self._colour_disabled()

    def _colour_disabled(self) -> None:
        readable = with_readable_disabled(self.palette())
        if readable != self.palette():
            self.setPalette(readable)

    def _fault_line(self) -> FaultLine:
        line = FaultLine()
        line.acknowledged.connect(self.acknowledged)
        return line

    def _lay_out(self) -> None:
        buttons = fill(QHBoxLayout(), self.acknowledge, self.sound, spacing=4, margins=(6, 0, 6, 0))
        title = fill(QHBoxLayout(), self.faults_title, margins=(8, 4, 8, 0))
        faults = _scrolled("Faults", self.faults, self.notes)
        faults.setMinimumHeight(_LEAST_FAULTS_PX)
        status = _scrolled("Status", self.components)
        pages = (status, self.events_tab, self.plots, _in_scroll_area("Recordings", self.recordings))
        for page, name in zip(pages, TABS, strict=True):
            self.tabs.addTab(page, name)
        self.tabs.setDocumentMode(True)
        self.tabs.setAccessibleName(", ".join(TABS))
        self.tabs.tabBar().setAccessibleName(f"{', '.join(TABS)} (Ctrl+1 to Ctrl+{len(TABS)})")
        above, below = _FAULTS_SHARE
        fill(QVBoxLayout(self), title, (faults, above), buttons, (self.tabs, below), spacing=4)


def _scrolled(name: str, *parts: QWidget) -> QScrollArea:
    inner = QWidget()
    fill(QVBoxLayout(inner), *parts, spacing=2).addStretch(1)
    return _in_scroll_area(name, inner)


def _in_scroll_area(name: str, inner: QWidget) -> QScrollArea:
    scroll = QScrollArea()
    scroll.setWidget(inner)
    scroll.setWidgetResizable(True)
    scroll.setFrameShape(QFrame.Shape.NoFrame)
    scroll.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    scroll.setAccessibleName(name)
    # Its height is the panel's to give, whatever it contains.
    scroll.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Ignored)
    return scroll
