"""Files that nobody else may read are refused when somebody can. common.private_files writes them."""

import os
import shlex
import stat
from pathlib import Path
from typing import Final

from common.errors import ExitCode, UserError

_LARGEST_BYTES: Final = 1 << 20
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
