"""Settings of the window that are kept between runs: place, size, and position of the splitter.

Kept in $XDG_CONFIG_HOME/robot-gateway/monitor.ini. A missing or broken file is ignored.
"""

from PySide6.QtCore import QByteArray, QSettings
from PySide6.QtWidgets import QSplitter, QWidget

_GEOMETRY = "window/geometry"
_DIVISION = "window/division"


def restore(window: QWidget, splitter: QSplitter) -> None:
    """Restores the saved settings; Qt ignores invalid ones."""
    settings = _settings()
    for key, restore_one in ((_GEOMETRY, window.restoreGeometry), (_DIVISION, splitter.restoreState)):
        value = settings.value(key)
        if isinstance(value, QByteArray):
            restore_one(value)


def save(window: QWidget, splitter: QSplitter) -> None:
    """Saves the settings for the next run."""
    settings = _settings()
    settings.setValue(_GEOMETRY, window.saveGeometry())
    settings.setValue(_DIVISION, splitter.saveState())
    settings.sync()


def _settings() -> QSettings:
    return QSettings(QSettings.Format.IniFormat, QSettings.Scope.UserScope, "robot-gateway", "monitor")
