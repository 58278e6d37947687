"""Settings of the window that are kept between runs: place, size, and position of the splitter."""

from PySide6.QtCore import QByteArray, QSettings
from PySide6.QtWidgets import QSplitter, QWidget

_GEOMETRY = "window/geometry"
_DIVISION = "window/division"


class WindowSettings:
    """Kept in $XDG_CONFIG_HOME/robot-gateway/monitor.ini. A missing or broken file is ignored."""

    def __init__(self) -> None:
        self._settings = QSettings(
            QSettings.Format.IniFormat, QSettings.Scope.UserScope, "robot-gateway", "monitor"
        )

    def restore(self, window: QWidget, splitter: QSplitter) -> None:
        """Restores the saved settings; Qt ignores invalid ones."""
        for key, restore in ((_GEOMETRY, window.restoreGeometry), (_DIVISION, splitter.restoreState)):
            value = self._settings.value(key)
            if isinstance(value, QByteArray):
                restore(value)

    def save(self, window: QWidget, splitter: QSplitter) -> None:
        """Saves the settings for the next run."""
        self._settings.setValue(_GEOMETRY, window.saveGeometry())
        self._settings.setValue(_DIVISION, splitter.saveState())
        self._settings.sync()
