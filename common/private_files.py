"""Files that nobody else may read, written at once or not at all, by one program at a time."""

import fcntl
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from common.errors import UserError

PRIVATE_FILE: Final = 0o600
PRIVATE_DIRECTORY: Final = 0o700
_LOCKED_WITHIN_S: Final = 5.0
_LOOK_EVERY_S: Final = 0.02


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


def _unwritable(path: Path, error: OSError) -> UserError:
    return UserError(
        f"{path} can't be written: {error.strerror}", "Look at the directory's rights and at the disk"
    )
