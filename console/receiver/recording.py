"""A file that keeps the encoded stream, over any number of connections."""

import fcntl
import os
import stat
import threading
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from common.errors import ExitCode, UserError

_CHUNK_BYTES: Final = 64 * 1024
_PIPE_BYTES: Final = 1 << 20
_F_SETPIPE_SZ: Final = 1031
_END_WITHIN_S: Final = 2.0


class Recording:
    """Takes an MPEG transport stream through a pipe and writes it down in a thread of its own.

    Connections write into the pipe, one after the other; GStreamer never waits for a disk. A recording that
    fails (a full disk) ends alone: what still comes is read and forgotten.

    Args:
        file: where to. What exists is never overwritten, devices excepted.

    Raises:
        UserError: the file exists already or can't be written.
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        self._lock = threading.Lock()
        self._trouble: UserError | None = None
        self._gaps = self._bytes = 0
        self._target = _opened(file)
        self._way_out, self.pipe = os.pipe()
        """`pipe` is the file descriptor that connections write to."""
        # A user with many pipes may get no larger one: then the queue before it holds more.
        with suppress(OSError):
            fcntl.fcntl(self.pipe, _F_SETPIPE_SZ, _PIPE_BYTES)
        os.set_blocking(self.pipe, False)
        self._closed = False
        self._writer = threading.Thread(target=self._write_down, name="recording", daemon=True)
        self._writer.start()

    def __enter__(self) -> Self:
        """It is open already."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Closes it."""
        self.close()

    @property
    def trouble(self) -> UserError | None:
        """Why it ended early; None while it goes on."""
        return self._trouble

    @property
    def gaps(self) -> int:
        """How often a part was left out because the disk was slower than the stream."""
        return self._gaps

    @property
    def size_bytes(self) -> int:
        """How much was written down so far."""
        return self._bytes

    def leave_out(self) -> None:
        """A part was lost; from any thread."""
        with self._lock:
            self._gaps += 1

    def close(self, within_s: float = _END_WITHIN_S) -> None:
        """Writes down what has come; no connection may use it any more. Closing again does nothing.

        Where nothing came there is no file: the next attempt may have its name.
        """
        if self._closed:
            return
        self._closed = True
        os.close(self.pipe)
        self._writer.join(within_s)
        if self._writer.is_alive():
            self._fail("the disk does not answer")

    def _fail(self, reason: str) -> None:
        self._trouble = self._trouble or UserError(
            f"the recording {self.file} ended early: {reason}", "Make room, or record somewhere else"
        )

    def _write_down(self) -> None:
        try:
            while chunk := os.read(self._way_out, _CHUNK_BYTES):
                if self._trouble is None:
                    self._write(memoryview(chunk))
            self._close_target()
        finally:
            os.close(self._way_out)

    def _write(self, rest: memoryview) -> None:
        try:
            while rest:
                written = os.write(self._target, rest)
                self._bytes += written
                rest = rest[written:]
        except OSError as error:
            self._fail(error.strerror or str(error))

    def _close_target(self) -> None:
        try:
            if self._bytes == 0 and stat.S_ISREG(os.fstat(self._target).st_mode):
                self.file.unlink(missing_ok=True)
            os.close(self._target)
        except OSError as error:
            # Some file systems say only now that there was no room.
            self._fail(error.strerror or str(error))


def _opened(file: Path) -> int:
    """A new file, or a device that exists."""
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
