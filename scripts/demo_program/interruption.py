"""A signal that ends the demo: Ctrl-C, or another program's.

The exception that a signal raises is not enough. Where it comes while a C library is calling Python, the
library may drop it, or crash, as PyGObject does while it makes a class. So the signal is remembered, and
looked at between steps.
"""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interruption:
    """From now on each of SIGNALS raises KeyboardInterrupt, but for those that the shell has us ignore."""

    def __init__(self) -> None:
        self._asked = self._deferring = False
        for number in SIGNALS:
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self._on_signal)

    def raise_if_asked(self) -> None:
        """Raises KeyboardInterrupt if a signal came."""
        if self._asked:
            raise KeyboardInterrupt

    @contextmanager
    def deferred(self) -> Iterator[None]:
        """Raises KeyboardInterrupt at the end of the block for a signal that comes within it."""
        self._deferring = True
        try:
            yield
        finally:
            self._deferring = False
        self.raise_if_asked()

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        self._asked = True
        if not self._deferring:
            raise KeyboardInterrupt
