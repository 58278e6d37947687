"""The preview's controls, in one row below the picture: state, cameras, switch, profiles."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QApplication, QHBoxLayout, QPushButton, QWidget

from console.client import PreviewProfile
from console.monitor.preview_controls import Controls
from console.presentation.preview_switch import PROFILES
from console.window.camera_menu import CameraMenu
from console.window.labels import PlainLabel, set_text, set_tool_tip
from console.window.layout import fill
from console.window.marked_word import MarkedWord

_TITLES = {
    PreviewProfile.LOW_BW: ("&Low bandwidth", "Key 1"),
    PreviewProfile.BALANCED: ("&Balanced", "Key 2"),
    PreviewProfile.HIGH_QUALITY: ("&High quality", "Key 3"),
}


class PreviewPanel(QWidget):
    """Shows the controls, and signals the operator's actions."""

    switched = Signal()
    """The switch was pressed."""
    chosen = Signal(object)
    """A profile's button was pressed; with the PreviewProfile."""

    camera_chosen = Signal(str)
    """A camera was chosen in the menu; with its name."""

    def __init__(self) -> None:
        super().__init__()
        self.camera = CameraMenu()
        self.camera.chosen.connect(self.camera_chosen)
        self.state = MarkedWord()
        self.switch = QPushButton("&Start preview")
        self.switch.setToolTip("Key P")
        self.switch.clicked.connect(self.switched)
        self.profiles = {profile: self._profile_button(profile) for profile in PROFILES}
        self._focused: QWidget | None = None
        self._lay_out()

    def show_controls(self, now: Controls) -> None:
        """Shows the latest controls."""
        self.state.show_word(now.style, now.mark, now.summary)
        set_text(self.switch, "&Stop preview" if now.on else "&Start preview")
        for profile, button in self.profiles.items():
            _check(button, profile, profile is now.profile)
        self.camera.show_cameras(now.cameras, now.wanted_camera)
        self._set_enabled(now.enabled)

    def _set_enabled(self, enabled: bool) -> None:
        """Enables or disables all buttons. Qt moves the focus away from a disabled one; it is given back."""
        if self.switch.isEnabled() == enabled:
            return
        focus = QApplication.focusWidget()
        buttons = (self.switch, self.camera, *self.profiles.values())
        if not enabled and focus in buttons:
            self._focused = focus
        for button in buttons:
            button.setEnabled(enabled)
        if enabled and self._focused:
            self._focused.setFocus()
            self._focused = None

    def _profile_button(self, profile: PreviewProfile) -> QPushButton:
        title, tip = _TITLES[profile]
        button = QPushButton(title)
        set_tool_tip(button, tip)
        button.setCheckable(True)
        _check(button, profile, True)
        button.setMinimumWidth(button.sizeHint().width())
        button.clicked.connect(lambda: self.chosen.emit(profile))
        return button

    def _lay_out(self) -> None:
        title, profiles = PlainLabel("Preview"), self.profiles.values()
        fill(QHBoxLayout(self), title, (self.state, 1), self.camera, self.switch, 8, *profiles, spacing=6)
        self.switch.setMinimumWidth(self.switch.sizeHint().width())


def _check(button: QPushButton, profile: PreviewProfile, checked: bool) -> None:
    """Checks a button, with a tick besides the style's own sign, which is faint in dark colours."""
    title, _ = _TITLES[profile]
    set_text(button, f"\u2713 {title}" if checked else title)
    button.setChecked(checked)
