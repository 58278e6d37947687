"""Records the encoded stream into a file, over any number of connections."""

import fcntl
import os
import stat
import threading
from contextlib import suppress
from pathlib import Path
from typing import Final

from common.errors import ExitCode, UserError

_CHUNK_BYTES: Final = 64 * 1024
_PIPE_BYTES: Final = 1 << 20
_F_SETPIPE_SZ: Final = 1031
"""Linux's fcntl(2) command, which the module fcntl does not name in every version of Python."""
_CLOSE_TIMEOUT_S: Final = 2.0


class Recording:
    """Takes an MPEG transport stream through a pipe and writes it to a file in a thread of its own.

    Connections write into the pipe, one after the other; GStreamer never waits for a disk. A recording that
    fails (a full disk) ends alone: what still comes is read and discarded.

    Args:
        file: a new file; an existing one is never overwritten, devices excepted.

    Raises:
        UserError: the file exists already or can't be written.
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        self._lock = threading.Lock()
        self.gaps = 0
        """How often a part was left out because the disk was slower than the stream."""
        self.size_bytes = 0
        """Bytes written so far."""
        self.error: UserError | None = None
        """Why it ended early; None while it goes on."""
        self._target = _open(file)
        self._read_end, self.pipe = os.pipe()
        """`pipe` is the file descriptor that connections write to."""
        # A user with many pipes may get no larger one: then the queue before it holds more.
        with suppress(OSError):
            fcntl.fcntl(self.pipe, _F_SETPIPE_SZ, _PIPE_BYTES)
        os.set_blocking(self.pipe, False)
        self._closed = False
        self._writer = threading.Thread(target=self._write_all, name="recording", daemon=True)
        self._writer.start()

    def add_gap(self) -> None:
        """Counts a lost part. Thread-safe."""
        with self._lock:
            self.gaps += 1

    def close(self, timeout_s: float = _CLOSE_TIMEOUT_S) -> None:
        """Writes what has come; no connection may use it any more. Closing again does nothing.

        An empty file is removed: the next attempt may have its name.
        """
        if self._closed:
            return
        self._closed = True
        os.close(self.pipe)
        self._writer.join(timeout_s)
        if self._writer.is_alive():
            self._fail("the disk does not answer")

    def _fail(self, reason: str) -> None:
        self.error = self.error or UserError(
            f"the recording {self.file} ended early: {reason}", "Make room, or record somewhere else"
        )

    def _write_all(self) -> None:
        try:
            while chunk := os.read(self._read_end, _CHUNK_BYTES):
                if self.error is None:
                    self._write(memoryview(chunk))
            self._close_target()
        finally:
            os.close(self._read_end)

    def _write(self, rest: memoryview) -> None:
        try:
            while rest:
                written = os.write(self._target, rest)
                self.size_bytes += written
                rest = rest[written:]
        except OSError as error:
            self._fail(error.strerror or str(error))

    def _close_target(self) -> None:
        try:
            if self.size_bytes == 0 and stat.S_ISREG(os.fstat(self._target).st_mode):
                self.file.unlink(missing_ok=True)
            os.close(self._target)
        except OSError as error:
            # Some file systems report a full disk only on close(2).
            self._fail(error.strerror or str(error))


def _open(file: Path) -> int:
    """Opens a new file, or a character device that exists."""
    flags = os.O_WRONLY | os.O_CLOEXEC
    try:
        if file.exists() and stat.S_ISCHR(file.stat().st_mode):
            return os.open(file, flags | os.O_NOCTTY)
        return os.open(file, flags | os.O_CREAT | os.O_EXCL, 0o644)
    except FileExistsError as error:
        raise UserError(
            f"{file} exists already", "Give the recording another name", exit_code=ExitCode.USAGE
        ) from error
    except OSError as error:
        raise UserError(
            f"{file} can't be written ({error.strerror or error})", "Give another place for the recording"
        ) from error
