"""The terminal's keyboard, key by key; whatever happens, the terminal gets its own manners back."""

import os
import sys
import termios
import tty
from contextlib import suppress
from types import TracebackType
from typing import Self

_MOST_BYTES = 1024


class Keyboard:
    """Standard input, which hands over each key at once and shows none of them while the block lasts.

    Ctrl-C and Ctrl-Z stay signals. Use it in a `with` block, on a terminal (see `there_is_one`).
    """

    def __init__(self) -> None:
        self.fileno = sys.stdin.fileno()
        self._before = termios.tcgetattr(self.fileno)

    def __enter__(self) -> Self:
        self.take()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.give_back()

    def take(self) -> None:
        """Key by key from now on. In the background of a shell this stops the program, until `fg`."""
        # Not when all output is drawn: that moment never comes while Ctrl-S holds it up.
        tty.setcbreak(self.fileno, termios.TCSANOW)

    def give_back(self) -> None:
        """As it was in the beginning."""
        # A terminal that was closed under us has no manners left to mend.
        with suppress(termios.error):
            termios.tcsetattr(self.fileno, termios.TCSANOW, self._before)

    def typed(self) -> str | None:
        """What was typed since; only when there is something to read. None when the terminal is gone."""
        try:
            data = os.read(self.fileno, _MOST_BYTES)
        except OSError:
            return None
        return data.decode("ascii", errors="replace") if data else None


def there_is_one() -> bool:
    """Whether somebody can type: standard input is a terminal, and this program is in its foreground."""
    try:
        return os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except (OSError, ValueError, AttributeError):
        # No terminal; a closed input; none at all.
        return False
