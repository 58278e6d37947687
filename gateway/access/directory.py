"""The directory of credentials: which file is what, how they are read, changed and kept from others.

    ca.pem  ca-key.pem             the robot's certificate authority
    server.pem  server-key.pem     what the gateway shows
    credentials.json               who may call: names, roles, hashes; no secret

The directory is 0700 and its files 0600. One program changes it at a time; each file changes at once or not
at all.
"""

import os
import stat
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from common.errors import ExitCode, UserError
from common.private_files import directory_lock, write_private
from gateway.access.authority import Pair
from gateway.access.command import to_type
from gateway.access.store import Store, parse_store, store_text

_OTHERS: Final = stat.S_IRWXG | stat.S_IRWXO
_LARGEST_BYTES: Final = 1 << 20
_STORE: Final = "credentials.json"
_AUTHORITY: Final = ("ca.pem", "ca-key.pem")
_SERVER: Final = ("server.pem", "server-key.pem")
_MADE_BY_INIT: Final = frozenset({_STORE, *_AUTHORITY, *_SERVER})


@dataclass(frozen=True, slots=True)
class CredentialDirectory:
    """The files of one robot below `path`."""

    path: Path

    @property
    def store_file(self) -> Path:
        """Who may call."""
        return self.path / _STORE

    @property
    def authority_files(self) -> tuple[Path, Path]:
        """Certificate and key of the robot's authority."""
        certificate, key = _AUTHORITY
        return self.path / certificate, self.path / key

    @property
    def server_files(self) -> tuple[Path, Path]:
        """Certificate and key that the gateway shows."""
        certificate, key = _SERVER
        return self.path / certificate, self.path / key

    def read_store(self) -> Store:
        """Who may call.

        Raises:
            UserError: there is none, it is damaged, or others may read it.
        """
        text = read_guarded(self.store_file, "list of credentials").decode("utf-8", errors="replace")
        try:
            return parse_store(text)
        except ValueError as error:
            raise UserError(
                f"the list of credentials {self.store_file} is damaged: {error}",
                f"Restore it from a copy, or begin anew: {to_type('init --again', self.path)}",
                exit_code=ExitCode.USAGE,
            ) from error

    def change_store(self, change: Callable[[Store], Store]) -> None:
        """Reads, changes and writes it while nobody else does.

        Raises:
            UserError: as `read_store`, or what `change` raises, or it can't be written.
        """
        # Before the lock, which would make a directory that is missing.
        self.read_store()
        with directory_lock(self.path):
            self.write_store(change(self.read_store()))

    def write_store(self, store: Store) -> None:
        """Replaces it.

        Raises:
            UserError: it can't be written.
        """
        write_private(self.store_file, store_text(store).encode())

    def read_authority(self) -> Pair:
        """The robot's certificate authority.

        Raises:
            UserError: it is not here, or others may read its key.
        """
        return read_pair(*self.authority_files, "certificate authority")

    def write_authority(self, pair: Pair) -> None:
        """Replaces it; what the old one signed is worth nothing from then on.

        Raises:
            UserError: it can't be written.
        """
        write_pair(*self.authority_files, pair)

    def read_server(self) -> Pair:
        """What the gateway shows.

        Raises:
            UserError: it is not here, or others may read its key.
        """
        return read_pair(*self.server_files, "server certificate")

    def write_server(self, pair: Pair) -> None:
        """Replaces it.

        Raises:
            UserError: it can't be written.
        """
        write_pair(*self.server_files, pair)


def read_pair(certificate: Path, key: Path, what: str) -> Pair:
    """A certificate and its key.

    Raises:
        UserError: they can't be read, or others may read the key.
    """
    return Pair(read_plain(certificate, what), read_guarded(key, f"key of the {what}"))


def write_pair(certificate: Path, key: Path, pair: Pair) -> None:
    """The key first: who reads in between finds two that don't match, and reads again.

    Raises:
        UserError: they can't be written.
    """
    write_private(key, pair.key)
    write_private(certificate, pair.certificate)


def read_plain(path: Path, what: str) -> bytes:
    """A file that may be anybody's to read.

    Raises:
        UserError: it can't be read.
    """
    return _read(path, what)[0]


def read_guarded(path: Path, what: str) -> bytes:
    """A file that is its owner's alone.

    Raises:
        UserError: it can't be read, or others may read or change it.
    """
    content, mode = _read(path, what)
    if mode & _OTHERS:
        raise UserError(
            f"others may use the {what} {path} (mode {mode:04o})",
            f"Type: chmod 600 {path}",
            exit_code=ExitCode.USAGE,
        )
    return content


def _read(path: Path, what: str) -> tuple[bytes, int]:
    try:
        # What is looked at is what is read: the file can't be exchanged in between.
        with path.open("rb") as file:
            mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
            content = file.read(_LARGEST_BYTES + 1)
    except OSError as error:
        raise UserError(
            f"the {what} {path} can't be read: {error.strerror}",
            _remedy(path, error),
            exit_code=ExitCode.USAGE,
        ) from error
    if len(content) > _LARGEST_BYTES:
        raise UserError(f"the {what} {path} is larger than 1 MiB", exit_code=ExitCode.USAGE)
    return content, mode


def _remedy(path: Path, error: OSError) -> str:
    """Making credentials is the way out only where there are none."""
    if isinstance(error, FileNotFoundError) and path.name in _MADE_BY_INIT:
        return f"Type: {to_type('init', path.parent)}"
    return "Look at its path and its rights: the gateway's user must be able to read it"
