"""The terminal's keyboard, read key by key, and what the keys mean."""

import os
import re
import sys
import termios
import tty
from collections.abc import Iterator
from contextlib import suppress
from enum import Enum
from typing import Final

_MOST_BYTES: Final = 1024
# Arrows, function keys and Alt with a letter send letters and digits that are not keys of their own
# (ECMA-48 5.4: a control sequence is ESC [, parameters 0x30-0x3F, intermediates 0x20-0x2F, final 0x40-0x7E).
_SEQUENCE: Final = re.compile(r"\x1b(?:\[[0-?]*[ -/]*[@-~]?|O.?|.)?", re.DOTALL)


class Key(Enum):
    """A key with a function."""

    TOGGLE = "p"
    LOW_BW = "1"
    BALANCED = "2"
    HIGH_QUALITY = "3"
    CAMERA = "v"
    QUIT = "q"


def keys_in(typed: str) -> Iterator[Key]:
    """Yields the keys among typed characters, in order, and skips the rest."""
    meanings = {key.value: key for key in Key}
    for character in _SEQUENCE.sub("", typed).lower():
        if character in meanings:
            yield meanings[character]


class Keyboard:
    """Standard input without line editing, echo and flow control. Ctrl-C and Ctrl-Z stay signals.

    It must be a terminal (see `has_keyboard`).
    """

    def __init__(self) -> None:
        self.fileno = sys.stdin.fileno()
        self._before = termios.tcgetattr(self.fileno)

    def take(self) -> None:
        """Enters cbreak mode. In the background of a shell this stops the program, until `fg`."""
        # Not TCSADRAIN: output never drains while Ctrl-S holds it up.
        tty.setcbreak(self.fileno, termios.TCSANOW)
        mode = termios.tcgetattr(self.fileno)
        # Ctrl-S is beside keys that drive, and holds up the program at its next output, and so every key.
        mode[tty.IFLAG] &= ~termios.IXON
        termios.tcsetattr(self.fileno, termios.TCSANOW, mode)

    def give_back(self) -> None:
        """Restores the terminal's mode."""
        # A terminal that was closed under the program has no mode to restore.
        with suppress(termios.error):
            termios.tcsetattr(self.fileno, termios.TCSANOW, self._before)

    def typed(self) -> str | None:
        """Returns what was typed, once there is something to read; None when the terminal is gone."""
        try:
            data = os.read(self.fileno, _MOST_BYTES)
        except OSError:
            return None
        return data.decode("ascii", errors="replace") if data else None


def has_keyboard() -> bool:
    """Returns whether standard input is a terminal, with this program in its foreground."""
    try:
        return os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except (OSError, ValueError, AttributeError):
        # No terminal; a closed input; none at all.
        return False
