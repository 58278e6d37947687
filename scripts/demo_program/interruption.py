"""Somebody wants the demo to end: Ctrl-C, or another program that tells it to.

The exception that a signal raises is not enough. Where it comes while a C library is calling Python, the
library may drop it, as PyGObject does while it loads. So the wish is remembered, and looked at between steps.
"""

import signal
from types import FrameType
from typing import Final, NoReturn

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interruption:
    """From now on each of SIGNALS raises KeyboardInterrupt, but for those that the shell has us ignore."""

    def __init__(self) -> None:
        self._asked = False
        for number in SIGNALS:
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self._on_signal)

    def raise_if_asked(self) -> None:
        """Raises KeyboardInterrupt when a signal came, even if nobody noticed."""
        if self._asked:
            raise KeyboardInterrupt

    def _on_signal(self, _number: int, _frame: FrameType | None) -> NoReturn:
        self._asked = True
        raise KeyboardInterrupt
