"""A file that keeps the encoded stream, over any number of connections."""

import stat
import threading
from pathlib import Path

from common.errors import ExitCode, UserError


class Recording:
    """Each connection appends what it receives: an MPEG transport stream, as it comes.

    A recording that fails (a full disk) ends; the picture does not.

    Args:
        file: where to. A file that exists is never overwritten.

    Raises:
        UserError: the file exists already or can't be written.
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        self._lock = threading.Lock()
        self._trouble: UserError | None = None
        self._gaps = 0
        try:
            if file.exists() and stat.S_ISREG(file.stat().st_mode):
                raise UserError(
                    f"{file} exists already", "Give the recording another name", exit_code=ExitCode.USAGE
                )
            with file.open("ab"):
                pass
        except OSError as error:
            raise UserError(
                f"{file} can't be written ({error.strerror or error})", "Give another place for the recording"
            ) from error

    @property
    def trouble(self) -> UserError | None:
        """Why it ended early; None while it goes on."""
        return self._trouble

    @property
    def gaps(self) -> int:
        """How often a part was left out because the disk was slower than the stream."""
        return self._gaps

    def size_bytes(self) -> int:
        """How much was kept so far; 0 where it can't be told."""
        try:
            return self.file.stat().st_size
        except OSError:
            return 0

    def is_writable(self) -> bool:
        """Whether a new connection may append to it: it has not failed, and the file can be opened still."""
        if self._trouble is None:
            try:
                with self.file.open("ab"):
                    pass
            except OSError as error:
                self.fail(error.strerror or str(error))
        return self._trouble is None

    def fail(self, reason: str) -> None:
        """It can't go on. The first reason counts; from any thread."""
        with self._lock:
            self._trouble = self._trouble or UserError(
                f"the recording {self.file} ended early: {reason}", "Make room, or record somewhere else"
            )

    def leave_out(self) -> None:
        """A part was lost; from any thread."""
        with self._lock:
            self._gaps += 1
