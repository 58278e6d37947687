"""Windows need Qt, which not every computer has."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from common.errors import UserError

_INSTALL: Final = "Type, in a clone of the project: scripts/install-console"
_LIBRARIES: Final = "Type: sudo apt install libegl1 libgl1 libxkbcommon-x11-0 libxcb-cursor0 libdbus-1-3"
_QT: Final = ("PySide6", "shiboken6")


@contextmanager
def needing_qt(otherwise: str = "") -> Iterator[None]:
    """In this block `console.window` is imported.

    Args:
        otherwise: how to do without a window; empty where there is no way.

    Raises:
        UserError: Qt is not installed, or a library of the system that it needs.
    """
    more = f"; {otherwise}" if otherwise else ""
    try:
        yield
    except ModuleNotFoundError as error:
        if not (error.name or "").startswith(_QT):
            raise
        raise UserError(f"the window needs Qt for Python, which is not installed{more}", _INSTALL) from error
    except ImportError as error:
        # The system's loader names no module, but the library it missed.
        if not (error.name or str(error)).startswith((*_QT, "lib")):
            raise
        raise UserError(f"Qt can't be loaded: {error}{more}", _LIBRARIES) from error
