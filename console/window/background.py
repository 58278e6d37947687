"""Work that may block (a disk, a sound device), in a thread of its own, one at a time."""

import threading
from collections.abc import Callable

from PySide6.QtCore import QObject, Signal

from console.presentation.preview_switch import Note
from console.window.handover import ThreadHandover


class BackgroundJob(QObject):
    """Runs one job at a time; its note is emitted in the window's thread.

    Args:
        parent: owns this object.
    """

    done = Signal(object)
    """A job has ended; with its Note, or None where there is nothing to report."""

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self._handover = ThreadHandover(self)
        self._handover.delivered.connect(self._finish)
        self._thread: threading.Thread | None = None
        self._note: Note | None = None

    def start(self, job: Callable[[], Note | None]) -> bool:
        """Starts a job. Returns False, and does nothing, while another one runs."""
        if self._thread:
            return False
        self._thread = threading.Thread(target=self._run, args=(job,), name="window-job", daemon=True)
        self._thread.start()
        return True

    def wait(self, timeout_s: float) -> None:
        """Waits for the end of a running job."""
        if self._thread:
            self._thread.join(timeout_s)

    def _run(self, job: Callable[[], Note | None]) -> None:
        try:
            self._note = job()
        finally:
            self._handover.post()

    def _finish(self) -> None:
        note, self._note, self._thread = self._note, None, None
        self.done.emit(note)
