"""What the window remembers from one day to the next: its place and size, and how it is divided."""

from PySide6.QtCore import QByteArray, QSettings
from PySide6.QtWidgets import QSplitter, QWidget

_GEOMETRY = "window/geometry"
_DIVISION = "window/division"


class Remembered:
    """Kept in $XDG_CONFIG_HOME/robot-gateway/monitor.ini. A broken file, or none, is no trouble."""

    def __init__(self) -> None:
        self._settings = QSettings(
            QSettings.Format.IniFormat, QSettings.Scope.UserScope, "robot-gateway", "monitor"
        )

    @property
    def file(self) -> str:
        """Where it is kept."""
        return self._settings.fileName()

    def restore(self, window: QWidget, splitter: QSplitter) -> None:
        """Puts the window where it was. What makes no sense is left out: Qt checks it."""
        geometry, division = self._bytes(_GEOMETRY), self._bytes(_DIVISION)
        if geometry:
            window.restoreGeometry(geometry)
        if division:
            splitter.restoreState(division)

    def keep(self, window: QWidget, splitter: QSplitter) -> None:
        """Remembers for the next time."""
        self._settings.setValue(_GEOMETRY, window.saveGeometry())
        self._settings.setValue(_DIVISION, splitter.saveState())
        self._settings.sync()

    def _bytes(self, key: str) -> QByteArray | None:
        value = self._settings.value(key)
        return value if isinstance(value, QByteArray) else None
