"""How long a thread of this process, which is to run every few milliseconds, did not run."""

import threading
import time
from types import TracebackType
from typing import Final, Self

_EVERY_S: Final = 0.005
_END_S: Final = 10.0


class Stalls:
    """Looks while its block lasts.

    What holds it up holds up whatever a test notes in this process, too: the time of an arrival for example.

    Attributes:
        longest_s: how late the thread has run at most.
    """

    def __init__(self) -> None:
        self.longest_s = 0.0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._look, name="stalls", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        self._thread.join(_END_S)

    def _look(self) -> None:
        due_s = time.monotonic() + _EVERY_S
        while not self._stop.wait(_EVERY_S):
            now_s = time.monotonic()
            self.longest_s = max(self.longest_s, now_s - due_s)
            due_s = now_s + _EVERY_S
