"""Settings of the window that are kept between runs: place and size, side panel, sound, exports.

Kept in $XDG_CONFIG_HOME/robot-gateway/monitor.ini. A missing or broken file is ignored.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from PySide6.QtCore import QByteArray, QSettings, QSize, Qt
from PySide6.QtWidgets import QWidget

_GEOMETRY: Final = "window/geometry"
_PANEL: Final = "window/panel"
_SOUND: Final = "alarm/sound"
_EXPORTS: Final = "recordings/exports"
_FIRST_SIZE: Final = QSize(1280, 800)
DECORATION: Final = QSize(16, 48)
"""What a desktop puts around a window, roughly."""


@dataclass(frozen=True, slots=True)
class Choices:
    """What the operator has chosen.

    Args:
        panel: whether the side panel is open.
        sound: whether alarms are heard.
        exports: folder of exported recordings; empty for the usual one.
    """

    panel: bool
    sound: bool
    exports: str = ""


def restore(window: QWidget) -> Choices:
    """Restores place and size, and returns the operator's choices; the first time the window is maximised."""
    settings = _settings()
    # No larger than a small laptop's screen leaves room for: the size after the maximised one.
    window.resize(_FIRST_SIZE.boundedTo(window.screen().availableSize() - DECORATION))
    value = settings.value(_GEOMETRY)
    if not (isinstance(value, QByteArray) and window.restoreGeometry(value)):
        window.setWindowState(Qt.WindowState.WindowMaximized)
    exports = settings.value(_EXPORTS)
    absolute = isinstance(exports, str) and Path(exports).is_absolute()
    return Choices(
        _flag(settings, _PANEL, True), _flag(settings, _SOUND, False), str(exports) if absolute else ""
    )


def save(window: QWidget, choices: Choices) -> None:
    """Saves the settings for the next run."""
    settings = _settings()
    settings.setValue(_GEOMETRY, window.saveGeometry())
    settings.setValue(_PANEL, choices.panel)
    settings.setValue(_SOUND, choices.sound)
    settings.setValue(_EXPORTS, choices.exports)
    settings.sync()


def _flag(settings: QSettings, key: str, default: bool) -> bool:
    # An INI file has no types: Qt reads back the words that it wrote, and from its cache the values.
    return {"true": True, "false": False}.get(str(settings.value(key)).lower(), default)


def _settings() -> QSettings:
    return QSettings(QSettings.Format.IniFormat, QSettings.Scope.UserScope, "robot-gateway", "monitor")
