"""A robot's credentials, read from the files of its entry. Secrets that others may read are refused."""

import os
import shlex
import shutil
import stat
import string
from pathlib import Path
from typing import Final

from common.errors import ExitCode, UserError
from console.credentials import Credentials
from console.robots.robots_file import Robot

_TOKEN_CHARACTERS: Final = frozenset(string.ascii_letters + string.digits + "-._~+/=")
"""b64token of RFC 6750 2.1."""
_LOGIN: Final = "Store the robot's login again: robotctl login NAME HOST:PORT FILE --replace"
_LARGEST_BYTES: Final = 1 << 20
_FOR_OTHERS: Final = stat.S_IRWXG | stat.S_IRWXO


def read_credentials(robot: Robot) -> Credentials:
    """Returns the contents of the files that the robot's entry names.

    Raises:
        UserError: A file is missing, or other users may read a secret; the line says what to type.
    """
    return Credentials(
        ca_certificate=_read_optional(robot.ca_certificate_file, "CA certificate file"),
        client_certificate=_read_optional(robot.client_certificate_file, "client certificate file"),
        client_key=read_private(robot.client_key_file, "client key file") if robot.client_key_file else None,
        token=_read_token(robot.token_file) if robot.token_file else None,
    )


def credentials_directory(robots_file: Path, name: str) -> Path:
    """Returns the directory of the files that robotctl keeps for a robot, beside the file of known robots."""
    return robots_file.parent / "credentials" / name


def forget_credentials(robots_file: Path, name: str) -> bool:
    """Deletes the files that robotctl keeps for a robot. Returns whether there were any.

    Raises:
        UserError: They can't be deleted.
    """
    directory = credentials_directory(robots_file, name)
    try:
        shutil.rmtree(directory)
    except FileNotFoundError:
        return False
    except OSError as error:
        raise UserError(f"{directory} can't be deleted: {error.strerror}", "Delete it yourself") from error
    return True


def read_public(path: Path, what: str) -> bytes:
    """Returns the content of a file without secrets, a certificate for example.

    Args:
        path: The file.
        what: Its kind, for the message: "CA certificate file".

    Raises:
        UserError: It is missing, unreadable or larger than 1 MiB.
    """
    return _read(path, what)[0]


def read_private(path: Path, what: str) -> bytes:
    """Returns the content of a file with a secret.

    Args:
        path: The file.
        what: Its kind, for the message: "token file".

    Raises:
        UserError: It is missing, another user's, or others may read or change it.
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


def _read_optional(path: Path | None, what: str) -> bytes | None:
    return read_public(path, what) if path else None


def _read_token(path: Path) -> str:
    text = read_private(path, "token file").decode("ascii", errors="replace").strip()
    if not text or not _TOKEN_CHARACTERS.issuperset(text):
        # Never the text itself: it may be a token with a typing error in it.
        raise _wrong(f"the token file {path} does not hold one token on one line", _LOGIN)
    return text


def _read(path: Path, what: str) -> tuple[bytes, os.stat_result]:
    try:
        # The status is that of the open file: it can't be exchanged between check and use.
        with path.open("rb") as file:
            status = os.fstat(file.fileno())
            content = file.read(_LARGEST_BYTES + 1)
    except OSError as error:
        raise _wrong(f"the {what} {path} can't be read: {error.strerror}", _LOGIN) from error
    if len(content) > _LARGEST_BYTES:
        raise _wrong(f"the {what} {path} is larger than 1 MiB", "Name the right file")
    return content, status


def _wrong(what: str, remedy: str) -> UserError:
    return UserError(what, remedy, exit_code=ExitCode.USAGE)
