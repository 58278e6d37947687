"""Keeps None, True and False alive under a Qt binding that gives them back more often than it took them.

Since Python 3.12 they can't be deallocated, whatever their reference count says, and PySide6 6.12 relies on
that on Python 3.11, too: every call that returns nothing takes one reference from None. After some ten
thousand calls, half a minute of a window with video, none is left, and the interpreter ends with "Fatal
Python error: none_dealloc". PySide6 6.11 and older count rightly.
"""

import ctypes
import sys
from typing import Final

from PySide6 import __version_info__ as pyside_version

_FIRST_TO_RELY_ON_IT: Final = (6, 12)
_MANY: Final = 1 << 40
"""More references than a window that is open for years could lose."""


def outlive_qt() -> None:
    """Gives the three more references than Qt can take; does nothing where that is not needed."""
    if sys.version_info >= (3, 12) or pyside_version[:2] < _FIRST_TO_RELY_ON_IT:
        return
    for singleton in (None, True, False):
        # In CPython up to 3.11 an object begins with its reference count.
        count = ctypes.c_ssize_t.from_address(id(singleton))
        if count.value < _MANY // 2:
            count.value += _MANY
