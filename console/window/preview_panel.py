"""The preview's controls below the picture: on and off, three profiles, what the robot answers."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QApplication, QHBoxLayout, QPushButton, QVBoxLayout, QWidget

from console.client import PreviewProfile
from console.monitor.preview_controls import PROFILES, Controls, Note
from console.tone import Tone
from console.window.header import MarkedWord
from console.window.labels import WrappedLabel, set_text, word_label
from console.window.line_list import LineList
from console.window.lines import TintedLine

_TITLES = {
    PreviewProfile.LOW_BW: ("&Low bandwidth", "Key 1"),
    PreviewProfile.BALANCED: ("&Balanced", "Key 2"),
    PreviewProfile.HIGH_QUALITY: ("&High quality", "Key 3"),
}


# An empty line: the picture above must not jump with every answer.
_NO_NOTE = (Note("", Tone.QUIET),)


class NoteLine(TintedLine):
    """One note."""

    def __init__(self) -> None:
        super().__init__()
        self.text = WrappedLabel()
        self.grid.addWidget(self.text, 0, 1)
        self.grid.setColumnStretch(1, 1)

    def show_item(self, item: Note) -> None:
        """Shows it."""
        self.show_tone(item.tone)
        self.marker.show_blank(not item.text)
        set_text(self.text, item.text)
        self.text.setToolTip(item.text)


class PreviewPanel(QWidget):
    """Signals what the operator does; shows what it is told."""

    switched = Signal()
    """On or off: the other of what is."""
    chosen = Signal(object)
    """A profile, as a PreviewProfile."""

    def __init__(self) -> None:
        super().__init__()
        self.state = MarkedWord()
        self.switch = QPushButton("&Start preview")
        self.switch.setToolTip("Key P")
        self.switch.clicked.connect(self.switched)
        self.profiles = {profile: self._profile_button(profile) for profile in PROFILES}
        self.notes: LineList[Note] = LineList(NoteLine)
        self._focus_goes_back_to: QWidget | None = None
        self._lay_out()

    def show_controls(self, now: Controls) -> None:
        """Shows the newest."""
        self.state.show_word(now.tone, now.mark, now.summary)
        text = "&Stop preview" if now.wanted else "&Start preview"
        if self.switch.text() != text:
            self.switch.setText(text)
        for profile, button in self.profiles.items():
            _check(button, profile, profile is now.profile)
        self._set_enabled(now.enabled)
        self.notes.show_items(now.notes or _NO_NOTE)

    def _set_enabled(self, enabled: bool) -> None:
        """Qt moves the focus away from a button that can't be pressed: it comes back with the button."""
        if self.switch.isEnabled() == enabled:
            return
        focus = QApplication.focusWidget()
        buttons = (self.switch, *self.profiles.values())
        if not enabled and focus in buttons:
            self._focus_goes_back_to = focus
        for button in buttons:
            button.setEnabled(enabled)
        if enabled and self._focus_goes_back_to:
            self._focus_goes_back_to.setFocus()
            self._focus_goes_back_to = None

    def _profile_button(self, profile: PreviewProfile) -> QPushButton:
        title, tip = _TITLES[profile]
        button = QPushButton(title)
        button.setToolTip(tip)
        button.setCheckable(True)
        _check(button, profile, True)
        button.setMinimumWidth(button.sizeHint().width())
        button.clicked.connect(lambda: self.chosen.emit(profile))
        return button

    def _lay_out(self) -> None:
        row = QHBoxLayout()
        row.setSpacing(6)
        row.addWidget(word_label("Preview"))
        row.addWidget(self.state, 1)
        row.addWidget(self.switch)
        row.addSpacing(8)
        for button in self.profiles.values():
            row.addWidget(button)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(4)
        layout.addLayout(row)
        layout.addWidget(self.notes)
        self.switch.setMinimumWidth(self.switch.sizeHint().width())


def _check(button: QPushButton, profile: PreviewProfile, checked: bool) -> None:
    """A tick besides the style's own way to show it, which is faint in dark colours."""
    title, _ = _TITLES[profile]
    text = f"\u2713 {title}" if checked else title
    if button.text() != text:
        button.setText(text)
    button.setChecked(checked)
