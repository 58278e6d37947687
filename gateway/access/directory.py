"""The directory of credentials: its files, how they are read and changed, and their permissions.

    ca.pem  ca-key.pem             the robot's certificate authority
    server.pem  server-key.pem     certificate and key of the gateway
    credentials.json               names, roles and hashes; no secret

The directory has mode 0700, its files 0600. A lock serializes programs that change it; each file is replaced
atomically.
"""

import os
import stat
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TypeVar

from common.errors import ExitCode, UserError
from common.private_files import directory_lock, write_private
from gateway.access.ca import KeyPair
from gateway.access.command import credentials_command
from gateway.access.store import Store, parse_store, store_text

_OTHERS: Final = stat.S_IRWXG | stat.S_IRWXO
_MAX_BYTES: Final = 1 << 20
_STORE: Final = "credentials.json"
_MADE_BY_INIT: Final = frozenset({_STORE, "ca.pem", "ca-key.pem", "server.pem", "server-key.pem"})

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class KeyPairFiles:
    """A certificate and its key on disk; `name` says in errors whose they are."""

    certificate: Path
    key: Path
    name: str

    def read(self) -> KeyPair:
        """Reads both.

        Raises:
            UserError: one can't be read, or others have permissions on the key.
        """
        return KeyPair(
            read_public(self.certificate, self.name), _read_private(self.key, f"key of the {self.name}")
        )

    def write(self, pair: KeyPair) -> None:
        """Replaces both: the key first. A reader in between finds that they do not match, and reads again.

        Raises:
            UserError: one can't be written.
        """
        write_private(self.key, pair.key)
        write_private(self.certificate, pair.certificate)


@dataclass(frozen=True, slots=True)
class CredentialDirectory:
    """The files of one robot below `path`."""

    path: Path

    @property
    def store_file(self) -> Path:
        """Path of the list of credentials."""
        return self.path / _STORE

    @property
    def ca(self) -> KeyPairFiles:
        """Files of the robot's CA."""
        return KeyPairFiles(self.path / "ca.pem", self.path / "ca-key.pem", "certificate authority")

    @property
    def server(self) -> KeyPairFiles:
        """Files of the gateway's certificate."""
        return KeyPairFiles(self.path / "server.pem", self.path / "server-key.pem", "server certificate")

    def read_store(self) -> Store:
        """Reads the list of credentials.

        Raises:
            UserError: it is missing or damaged, or others have permissions on it.
        """
        text = _read_private(self.store_file, "list of credentials").decode("utf-8", errors="replace")
        try:
            return parse_store(text)
        except ValueError as error:
            raise UserError(
                f"the list of credentials {self.store_file} is damaged: {error}",
                f"Restore a copy, or start again with: {credentials_command('init --again', self.path)}",
                exit_code=ExitCode.USAGE,
            ) from error

    def write_store(self, store: Store) -> None:
        """Replaces the list of credentials.

        Raises:
            UserError: it can't be written.
        """
        write_private(self.store_file, store_text(store).encode())

    def change_store(self, change: Callable[[Store], tuple[Store, _T]]) -> _T:
        """Replaces the list by the one that `change` returns, under the lock; returns its second result.

        Raises:
            UserError: as `read_store`; what `change` raises; or it can't be written.
        """
        # Read before the lock, which would create a missing directory.
        self.read_store()
        with directory_lock(self.path):
            store, result = change(self.read_store())
            self.write_store(store)
        return result


def read_public(path: Path, name: str) -> bytes:
    """Reads a file that others may read.

    Raises:
        UserError: it can't be read.
    """
    return _read(path, name)[0]


def _read_private(path: Path, name: str) -> bytes:
    content, mode = _read(path, name)
    if mode & _OTHERS:
        raise UserError(
            f"other users have access to the {name} {path} (mode {mode:04o})",
            f"Type: chmod 600 {path}",
            exit_code=ExitCode.USAGE,
        )
    return content


def _read(path: Path, name: str) -> tuple[bytes, int]:
    try:
        # The mode is that of the opened file, which can't be exchanged between check and read.
        with path.open("rb") as file:
            mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
            content = file.read(_MAX_BYTES + 1)
    except OSError as error:
        raise UserError(
            f"the {name} {path} can't be read: {error.strerror}",
            _remedy(path, error),
            exit_code=ExitCode.USAGE,
        ) from error
    if len(content) > _MAX_BYTES:
        raise UserError(f"the {name} {path} is larger than 1 MiB", exit_code=ExitCode.USAGE)
    return content, mode


def _remedy(path: Path, error: OSError) -> str:
    """Suggests `init` only for missing files that it creates: it must not replace a purchased certificate."""
    if isinstance(error, FileNotFoundError) and path.name in _MADE_BY_INIT:
        return f"Type: {credentials_command('init', path.parent)}"
    return "Check its path and permissions: the gateway's user must be able to read it"
