"""Files that nobody else may read: written so, and refused when they are not so."""

import fcntl
import os
import shlex
import stat
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from common.errors import ExitCode, UserError

PRIVATE_FILE: Final = 0o600
PRIVATE_DIRECTORY: Final = 0o700
_LARGEST_BYTES: Final = 1 << 20
_LOCKED_WITHIN_S: Final = 5.0
_LOOK_EVERY_S: Final = 0.02
_FOR_OTHERS: Final = stat.S_IRWXG | stat.S_IRWXO


def read_private(path: Path, what: str) -> bytes:
    """The content of a file that only its owner may read.

    Args:
        path: the file.
        what: what it is, for the message: "token file".

    Raises:
        UserError: it is not there, too large, somebody else's, or others have rights on it.
    """
    content, status = _read(path, what)
    if status.st_uid not in (os.geteuid(), 0):
        raise _wrong(f"the {what} {path} belongs to another user", "Make a copy of your own")
    if others := stat.S_IMODE(status.st_mode) & _FOR_OTHERS:
        mode = stat.S_IMODE(status.st_mode)
        verb = "read" if others & (stat.S_IRGRP | stat.S_IROTH) else "use"
        raise _wrong(
            f"others may {verb} the {what} {path} (mode {mode:04o})",
            f"Type: chmod 600 {shlex.quote(str(path))}",
        )
    return content


def read_public(path: Path, what: str) -> bytes:
    """The content of a file that may be anybody's to read, a certificate for example.

    Raises:
        UserError: it is not there, can't be read, or is too large.
    """
    return _read(path, what)[0]


def write_private(path: Path, content: bytes) -> None:
    """Writes a file at once or not at all; only its owner may read it, at no moment anybody else.

    Directories that are missing are made for the owner alone.

    Raises:
        UserError: it can't be written there.
    """
    try:
        _make_directory(path.parent)
        # A link stays a link: what it points to is replaced. Temporary files are made with mode 0600.
        path = path.resolve()
        handle, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    except OSError as error:
        raise _unwritable(path, error) from error
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(temporary).replace(path)
    except OSError as error:
        Path(temporary).unlink(missing_ok=True)
        raise _unwritable(path, error) from error
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


@contextmanager
def alone_in(directory: Path) -> Iterator[None]:
    """Nobody else who asks here changes the directory's files meanwhile; it is made when it is missing.

    Raises:
        UserError: it can't be made, or somebody is still at it after 5 s.
    """
    try:
        _make_directory(directory)
        handle = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError as error:
        raise _unwritable(directory, error) from error
    try:
        _lock(handle, directory)
        yield
    finally:
        # Closing gives the lock back.
        os.close(handle)


def _make_directory(directory: Path) -> None:
    missing = [each for each in (directory, *directory.parents) if not each.exists()]
    for each in reversed(missing):
        each.mkdir(mode=PRIVATE_DIRECTORY, exist_ok=True)


def _lock(handle: int, directory: Path) -> None:
    give_up_s = time.monotonic() + _LOCKED_WITHIN_S
    while True:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            if time.monotonic() > give_up_s:
                raise UserError(
                    f"another program has been changing {directory} for {_LOCKED_WITHIN_S:g} s",
                    "Try again when it has ended",
                ) from error
            time.sleep(_LOOK_EVERY_S)
        else:
            return


def _read(path: Path, what: str) -> tuple[bytes, os.stat_result]:
    try:
        # What is looked at is what is read: the file can't be exchanged in between.
        with path.open("rb") as file:
            status = os.fstat(file.fileno())
            content = file.read(_LARGEST_BYTES + 1)
    except OSError as error:
        raise _wrong(f"the {what} {path} can't be read: {error.strerror}", "Type: robotctl login") from error
    if len(content) > _LARGEST_BYTES:
        raise _wrong(f"the {what} {path} is larger than 1 MiB", "Name the right file")
    return content, status


def _wrong(what: str, remedy: str) -> UserError:
    return UserError(what, remedy, exit_code=ExitCode.USAGE)


def _unwritable(path: Path, error: OSError) -> UserError:
    return UserError(
        f"{path} can't be written: {error.strerror}", "Look at the directory's rights and at the disk"
    )
