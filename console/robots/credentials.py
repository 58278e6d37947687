"""What proves to a robot who asks, read from the files that its entry names."""

import shutil
import string
from pathlib import Path
from typing import Final

from common.errors import ExitCode, UserError
from console.client import Credentials
from console.robots.book import Robot
from console.robots.private import read_private, read_public

_TOKEN_CHARACTERS: Final = frozenset(string.ascii_letters + string.digits + "-._~+/=")


def read_credentials(robot: Robot) -> Credentials:
    """Everything the robot's entry names.

    Raises:
        UserError: a file is missing, or others may read a secret; the line says what to type.
    """
    return Credentials(
        ca_certificate=_public(robot.ca_certificate_file, "CA certificate file"),
        client_certificate=_public(robot.client_certificate_file, "client certificate file"),
        client_key=read_private(robot.client_key_file, "client key file") if robot.client_key_file else None,
        token=_token(robot.token_file) if robot.token_file else None,
    )


def credentials_directory(book: Path, name: str) -> Path:
    """Where robotctl itself keeps a robot's files: beside the file of known robots, for their owner alone."""
    return book.parent / "credentials" / name


def forget_credentials(book: Path, name: str) -> bool:
    """Deletes what robotctl itself keeps for a robot. Whether there was anything.

    Raises:
        UserError: it can't be deleted.
    """
    directory = credentials_directory(book, name)
    try:
        shutil.rmtree(directory)
    except FileNotFoundError:
        return False
    except OSError as error:
        raise UserError(f"{directory} can't be deleted: {error.strerror}", "Delete it yourself") from error
    return True


def _public(path: Path | None, what: str) -> bytes | None:
    return read_public(path, what) if path else None


def _token(path: Path) -> str:
    text = read_private(path, "token file").decode("ascii", errors="replace").strip()
    if not text or not _TOKEN_CHARACTERS.issuperset(text):
        # Never the text itself: it may be a token with a slip in it.
        raise UserError(
            f"the token file {path} does not hold one token on one line",
            "Type: robotctl login",
            exit_code=ExitCode.USAGE,
        )
    return text
