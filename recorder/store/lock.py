"""One recorder to a folder: the lock, which the kernel releases when the recorder ends, however it ends."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from common.errors import UserError
from recorder.store.folder import make_directory

_LOCK: Final = "lock"
_MODE: Final = 0o640


def has_lock(folder: Path) -> bool:
    """Returns whether a folder has the file of such a lock."""
    return (folder / _LOCK).is_file()


@contextmanager
def folder_lock(root: Path) -> Iterator[None]:
    """Holds the lock of a folder of recordings, or of a ring of its own, which is made if it is missing.

    Raises:
        UserError: another recorder has the folder, or it can't be used.
    """
    path = root / _LOCK
    try:
        make_directory(root)
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, _MODE)
    except OSError as error:
        raise UserError(
            f"the folder of recordings {root} can't be used: {error.strerror}",
            "Make it a directory that the recorder's user may write to, or set root",
        ) from error
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        holder = os.read(handle, 32).decode("ascii", "replace").strip()
        os.close(handle)
        raise UserError(
            f"another recorder (process {holder or 'unknown'}) uses the folder {root}",
            "Stop it, or set root to a folder of its own",
        ) from error
    try:
        os.ftruncate(handle, 0)
        os.write(handle, f"{os.getpid()}\n".encode())
        yield
    finally:
        # Closing the descriptor releases the lock; the file stays, so that two can never lock different ones.
        os.close(handle)
