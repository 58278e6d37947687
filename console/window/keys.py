"""Keys of a window."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from PySide6.QtCore import Qt
from PySide6.QtGui import QShortcut
from PySide6.QtWidgets import QWidget

_FULL_SCREEN = Qt.WindowState.WindowFullScreen


@dataclass(frozen=True, slots=True)
class Key:
    """Keys that do the same.

    Args:
        names: as `QKeySequence` names them.
        does: what they do, for the operator.
        act: the function that is called; None where other code reads the keys.
    """

    names: tuple[str, ...]
    does: str
    act: Callable[[], object] | None

    @property
    def shown(self) -> str:
        """The names for the operator."""
        return ", ".join(self.names)


def full_screen_key(window: QWidget, *names: str) -> Key:
    """Returns the key that switches a window to the full screen and back."""
    return Key(
        names, "full screen and back", lambda: window.setWindowState(window.windowState() ^ _FULL_SCREEN)
    )


def leave_full_screen(window: QWidget) -> None:
    """Leaves the full screen; a window that is not in it stays as it is."""
    window.setWindowState(window.windowState() & ~_FULL_SCREEN)


def bind_keys(window: QWidget, keys: Sequence[Key]) -> None:
    """Makes keys call functions while the window is active."""
    for key in keys:
        for name in key.names if key.act else ():
            QShortcut(name, window, key.act)
