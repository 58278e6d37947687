"""Tab of the recordings: what is recorded now, the list, and the copy of one to this computer."""

from pathlib import Path
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QAbstractButton,
    QComboBox,
    QGridLayout,
    QHBoxLayout,
    QLineEdit,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from console.monitor.recorder_controls import (
    WAITING,
    Action,
    PresetChoice,
    RecorderControls,
    RecordingItem,
)
from console.monitor.recordings_view import ExportState
from console.window.cell import SmallLabel
from console.window.labels import WrappedLabel, plain_tip, scale_font, set_text, set_tool_tip
from console.window.layout import fill
from console.window.lines import LineList, NoteLine
from console.window.marked_word import MarkedWord
from console.window.recording_list import RecordingList

_LONGEST_LABEL: Final = 100
"""What the contract takes."""
_SMALL: Final = 0.85
_PARTS: Final = 1000
"""Of the progress bar: the sizes of files exceed its numbers."""


class RecordingsTab(QWidget):
    """Shows the controls, and signals the operator's actions; below the list are those for its choice."""

    record_pressed = Signal()
    """Starts a recording, or stops the one that runs."""
    keep_pressed = Signal()
    export_pressed = Signal(object)
    """Begins the export of a RecordingItem, or cancels it."""
    pin_pressed = Signal(object)
    delete_pressed = Signal(object)
    folder_pressed = Signal()
    """Another folder for exports is to be chosen."""
    preset_chosen = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.state, self.running, self.room = MarkedWord(), SmallLabel(), SmallLabel()
        self.notes = LineList(NoteLine)
        self.presets, self.label = QComboBox(), QLineEdit()
        self.meaning, self.why = _small(), _small()
        self.record, self.keep = QPushButton("Record"), QPushButton("Keep the last 30 s")
        self.listed, self.list = SmallLabel(), RecordingList()
        self.export, self.pin = QPushButton("Resume export"), QPushButton("Unpin")
        self.delete = QPushButton("Delete ...")
        self.folder, self.bar, self.copied = QPushButton("Folder ..."), QProgressBar(), _small()
        self._controls = RecorderControls()
        self._choices: tuple[PresetChoice, ...] = ()
        self._name_parts()
        self._lay_out()
        self._connect()
        self.show_controls(self._controls)

    @property
    def preset(self) -> str:
        """The name of the chosen preset; empty while none is known."""
        return self.presets.currentData() or ""

    def show_controls(self, now: RecorderControls) -> None:
        """Shows the latest controls."""
        self._controls = now
        self.state.show_word(now.style, now.mark, "")
        set_text(self.running, now.running)
        set_text(self.room, now.room)
        self.notes.show_items(now.notes)
        self.notes.setVisible(bool(now.notes))
        self._show_presets(now.presets)
        _show(self.record, now.record)
        _show(self.keep, now.keep)
        set_text(self.why, _reasons(now.record, now.keep))
        self.why.setVisible(bool(self.why.text()))
        for part in (self.presets, self.label):
            part.setEnabled(now.record.enabled and not now.on)
        set_text(self.listed, now.listed)
        self.list.show_items(now.items)
        self._show_chosen()

    def show_folder(self, folder: Path) -> None:
        """Says where exports are put."""
        set_tool_tip(self.folder, f"Exports are put into {folder}")
        self.folder.setAccessibleDescription(f"Exports are put into {folder}")

    def _show_presets(self, choices: tuple[PresetChoice, ...]) -> None:
        if choices != self._choices:
            self._choices, chosen = choices, self.preset
            self.presets.clear()
            for number, each in enumerate(choices):
                self.presets.addItem(each.name, each.name)
                self.presets.setItemData(number, plain_tip(each.meaning), Qt.ItemDataRole.ToolTipRole)
            self.presets.setCurrentIndex(max(0, self.presets.findData(chosen)))
        meaning = next((each.meaning for each in choices if each.name == self.preset), "")
        set_text(self.meaning, meaning)
        self.presets.setAccessibleDescription(meaning)

    def _show_chosen(self) -> None:
        """Shows the buttons for the chosen recording."""
        chosen = self.list.chosen
        none = "There is no recording to choose" if not self.list.count() else "No recording is chosen"
        for button, action in (
            (self.export, chosen.export if chosen else Action("Export", none)),
            (self.pin, chosen.pin if chosen else Action("Pin", none)),
            (self.delete, chosen.delete if chosen else Action("Delete ...", none)),
        ):
            _show(button, action)
        running = _is_copied(chosen)
        self.bar.setVisible(running)
        if chosen and chosen.copy and running:
            total = chosen.copy.total
            self.bar.setRange(0, _PARTS if total else 0)
            self.bar.setValue(chosen.copy.done * _PARTS // total if total else 0)
        reasons = _reasons(chosen.export, chosen.pin, chosen.delete) if chosen else ""
        set_text(self.copied, (chosen.copied if chosen else "") or reasons)
        self.copied.setVisible(bool(self.copied.text()))

    def _name_parts(self) -> None:
        self.record.setToolTip("Key C")
        self.keep.setToolTip("Key K")
        self.presets.setAccessibleName("Preset: what is recorded")
        self.label.setAccessibleName("Label of the next recording, optional")
        self.label.setPlaceholderText("Label (optional)")
        self.label.setMaxLength(_LONGEST_LABEL)
        self.bar.setAccessibleName("Progress of the export")
        self.bar.setMaximumHeight(12)
        self.bar.setTextVisible(False)

    def _lay_out(self) -> None:
        for button in (self.record, self.keep, self.export, self.pin, self.delete, self.folder):
            button.setMinimumWidth(button.sizeHint().width())
        chosen = fill(QHBoxLayout(), (self.presets, 1), (self.label, 1), spacing=4)
        buttons = fill(QHBoxLayout(), (self.record, 1), (self.keep, 1), spacing=4)
        below = QGridLayout()
        below.setSpacing(4)
        for number, button in enumerate((self.export, self.folder, self.pin, self.delete)):
            below.addWidget(button, number // 2, number % 2)
        whole = fill(
            QVBoxLayout(self),
            *(self.state, self.running, self.room, self.notes),
            *(chosen, self.meaning, buttons, self.why, self.listed, (self.list, 1), self.bar, self.copied),
            spacing=3,
            margins=(6, 6, 6, 4),
        )
        whole.addLayout(below)

    def _connect(self) -> None:
        self.record.clicked.connect(self.record_pressed)
        self.keep.clicked.connect(self.keep_pressed)
        self.folder.clicked.connect(self.folder_pressed)
        self.presets.activated.connect(self.preset_chosen)
        self.list.currentItemChanged.connect(self._show_chosen)
        for button, signal in (
            (self.export, self.export_pressed),
            (self.pin, self.pin_pressed),
            (self.delete, self.delete_pressed),
        ):
            button.clicked.connect(lambda _=False, signal=signal: signal.emit(self.list.chosen))


def _show(button: QAbstractButton, action: Action) -> None:
    """Shows an action; a button that can't be pressed says why in its tool tip, and to a screen reader."""
    set_text(button, action.text)
    button.setEnabled(action.enabled)
    button.setAccessibleDescription(action.reason)
    if action.reason:
        set_tool_tip(button, action.reason)
    else:
        button.setToolTip("")


def _reasons(*actions: Action) -> str:
    """Returns why actions can't be used, each reason once; without what lasts a moment only."""
    reasons = dict.fromkeys(each.reason for each in actions if each.reason not in ("", WAITING))
    return ". ".join(reasons)


def _is_copied(chosen: RecordingItem | None) -> bool:
    return bool(chosen and chosen.copy and chosen.copy.state is ExportState.RUNNING)


def _small() -> WrappedLabel:
    label = WrappedLabel()
    scale_font(label, _SMALL)
    return label
