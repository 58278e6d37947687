"""Keys of a window."""

from collections.abc import Callable, Mapping

from PySide6.QtCore import Qt
from PySide6.QtGui import QShortcut
from PySide6.QtWidgets import QWidget

_FULL_SCREEN = Qt.WindowState.WindowFullScreen


def bind_keys(
    window: QWidget, keys: Mapping[str, Callable[[], object]], full_screen: tuple[str, ...] = ("F11",)
) -> None:
    """Makes keys call functions.

    Args:
        window: the window that has the keys while it is active.
        keys: function by key, as `QKeySequence` names it.
        full_screen: keys that switch to the full screen and back; Esc leaves it, too.
    """
    toggles = dict.fromkeys(full_screen, lambda: window.setWindowState(window.windowState() ^ _FULL_SCREEN))
    leaves = {"Esc": lambda: window.setWindowState(window.windowState() & ~_FULL_SCREEN)}
    for key, act in {**keys, **toggles, **leaves}.items():
        QShortcut(key, window, act)
