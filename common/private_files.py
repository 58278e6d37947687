"""Files readable by their owner alone: atomic replacement, and an advisory lock on their directory."""

import errno
import fcntl
import os
import stat
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from common.errors import UserError

PRIVATE_FILE: Final = 0o600
PRIVATE_DIRECTORY: Final = 0o700
_LOCK_TIMEOUT_S: Final = 5.0
_LOCK_RETRY_S: Final = 0.02


def write_private(path: Path, content: bytes, *, keep_owner: bool = False) -> None:
    """Replaces one file; see `write_all_private`."""
    write_all_private({path: content}, keep_owner=keep_owner)


def write_all_private(contents: Mapping[Path, bytes], *, keep_owner: bool = False) -> None:
    """Replaces files by new ones with mode 0600, in this order; creates missing directories with 0700.

    Each is replaced atomically (rename(2)), and none before all are on the disk: after an error they are as
    before, after a crash each has either the old or the new content. What was replaced survives a power loss.

    Args:
        contents: of the files, by path.
        keep_owner: whether a file that is replaced keeps its owner and group, which takes the right to give
            files away where they are not this user's.

    Raises:
        UserError: one can't be written.
    """
    temporaries: dict[Path, Path] = {}
    path = Path()
    try:
        for path, content in contents.items():
            make_directory(path.parent)
            # A symbolic link stays one: its target is replaced. mkstemp creates files with mode 0600.
            target = path.resolve()
            handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
            temporaries[target] = Path(name)
            with os.fdopen(handle, "wb") as file:
                if keep_owner and target.exists():
                    status = target.stat()
                    os.fchown(handle, status.st_uid, status.st_gid)
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
        for path, temporary in temporaries.items():
            temporary.replace(path)
        for directory in {target.parent for target in temporaries}:
            sync_directory(directory)
    except OSError as error:
        raise _unwritable(path, error) from error
    finally:
        for temporary in temporaries.values():
            temporary.unlink(missing_ok=True)


def sync_directory(directory: Path) -> None:
    """Makes new and renamed files of a directory survive a power loss (fsync(2)).

    Raises:
        OSError: the disk fails.
    """
    handle = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(handle)
    except OSError as error:
        # Some network file systems can't.
        if error.errno != errno.EINVAL:
            raise
    finally:
        os.close(handle)


def make_directory(directory: Path, mode: int = PRIVATE_DIRECTORY) -> None:
    """Makes a directory and its missing parents; afterwards they survive a power loss.

    Args:
        directory: the last of them.
        mode: of those that were missing.

    Raises:
        OSError: one can't be made.
    """
    missing = [each for each in (directory, *directory.parents) if not each.exists()]
    for each in reversed(missing):
        each.mkdir(mode=mode, exist_ok=True)
        sync_directory(each.parent)


def make_own_directory(directory: Path) -> None:
    """Makes sure that a directory exists, belongs to this user, and is closed to all others (mode 0700).

    Where every user may write, as in /tmp, another one may have made a directory or link of that name first.

    Raises:
        OSError: it can't be made, is a symbolic link, or is another user's or everyone's (sticky).
    """
    make_directory(directory)
    handle = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        status = os.fstat(handle)
        if status.st_uid != os.geteuid() or status.st_mode & stat.S_ISVTX:
            raise PermissionError(errno.EPERM, "it is not this user's own", str(directory))
        os.fchmod(handle, PRIVATE_DIRECTORY)
    finally:
        os.close(handle)


@contextmanager
def directory_lock(directory: Path) -> Iterator[None]:
    """Holds the exclusive advisory lock (flock(2)) of a directory, which is created if missing.

    Raises:
        UserError: it can't be created, or another program holds the lock for more than 5 s.
    """
    try:
        make_directory(directory)
        handle = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError as error:
        raise _unwritable(directory, error) from error
    try:
        _lock(handle, directory)
        yield
    finally:
        # Closing the descriptor releases the lock.
        os.close(handle)


def _lock(handle: int, directory: Path) -> None:
    give_up_s = time.monotonic() + _LOCK_TIMEOUT_S
    while True:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            if time.monotonic() > give_up_s:
                raise UserError(
                    f"another program has been changing {directory} for {_LOCK_TIMEOUT_S:g} s",
                    "Try again when it has finished",
                ) from error
            time.sleep(_LOCK_RETRY_S)
        else:
            return


def _unwritable(path: Path, error: OSError) -> UserError:
    what = f"{path} can't be written: {error.strerror}"
    return UserError(what, "Check the permissions of the directory and the free disk space")
