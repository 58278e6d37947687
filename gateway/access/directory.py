"""The directory of credentials: its files, how they are read and changed, and their permissions.

    ca.pem  ca-key.pem             the robot's certificate authority
    server.pem  server-key.pem     certificate and key of the gateway
    credentials.json               names, roles and hashes; no secret

The directory has mode 0700, its files 0600. A lock serializes programs that change it; each file is replaced
atomically.
"""

import os
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TypeVar

from common.ca import KeyPair, key_matches
from common.errors import ExitCode, UserError
from common.private_files import directory_lock, write_private
from gateway.access.command import credentials_command
from gateway.access.store import Store, parse_store, store_text

_ROOT: Final = 0
_OTHERS: Final = stat.S_IRWXG | stat.S_IRWXO
_MAX_BYTES: Final = 1 << 20
_STORE: Final = "credentials.json"
_MADE_BY_INIT: Final = frozenset({_STORE, "ca.pem", "ca-key.pem", "server.pem", "server-key.pem"})
_REPLACEMENTS: Final = {
    "server": (
        "replace both (HOST: a name by which laptops reach this robot)",
        "rotate server --host HOST",
    ),
    "ca": ("make a new authority, whose certificate every laptop then needs", "rotate ca"),
}
"""By the argument of `rotate`: what it does, and the command."""

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class KeyPairFiles:
    """A certificate and its key on disk.

    Attributes:
        name: says in errors whose they are.
        argument: of the command `rotate` that replaces them.
    """

    certificate: Path
    key: Path
    name: str
    argument: str = "server"

    def read(self) -> KeyPair:
        """Reads both.

        Raises:
            UserError: one can't be read, others have permissions on the key, or they do not match.
        """
        pair = KeyPair(
            read_public(self.certificate, self.name), _read_private(self.key, f"key of the {self.name}")
        )
        try:
            matches = key_matches(pair)
        except ValueError as error:
            raise self.unparsed(error) from error
        if not matches:
            raise UserError(
                f"{self.key} is not the key of {self.certificate}",
                f"To replace both, type: {credentials_command(f'rotate {self.argument}', self.key.parent)}",
            )
        return pair

    def unparsed(self, error: ValueError) -> UserError:
        """Returns the error of a certificate or key that can't be parsed."""
        return UserError(
            f"a certificate or key of {self.certificate} can't be parsed: {error}",
            f"Restore copies of both, or {_replacement(self.certificate, self.argument)}"
            if _made_by_init(self.certificate)
            else "Replace them by PEM files, the key without a passphrase",
        )

    def contents(self, pair: KeyPair) -> dict[Path, bytes]:
        """Returns what to write, the key first: a reader in between finds no match, and reads again."""
        return {self.key: pair.key, self.certificate: pair.certificate}


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
        return KeyPairFiles(self.path / "ca.pem", self.path / "ca-key.pem", "certificate authority", "ca")

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

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keeps other programs from changing the directory while the block lasts.

        Raises:
            UserError: as `read_store`, or the lock is not free.
        """
        # Read before the lock, which would create a missing directory.
        self.read_store()
        with directory_lock(self.path):
            yield

    def change_store(self, change: Callable[[Store], tuple[Store, _T]]) -> _T:
        """Replaces the list by the one that `change` returns, under the lock; returns its second result.

        Raises:
            UserError: as `read_store`; what `change` raises; or it can't be written.
        """
        with self.locked():
            store, result = change(self.read_store())
            write_private(self.store_file, store_text(store).encode())
        return result


def read_public(path: Path, name: str) -> bytes:
    """Reads a file that others may read.

    Raises:
        UserError: it can't be read.
    """
    return _read(path, name)[0]


def read_authority(path: Path, parse: Callable[[bytes], _T]) -> _T:
    """Returns what `parse` makes of the certificate of an authority.

    Raises:
        UserError: it can't be read, or `parse` raises a ValueError.
    """
    try:
        return parse(read_public(path, "certificate authority"))
    except ValueError as error:
        raise UserError(
            f"the certificate authority {path} can't be parsed: {error}",
            f"Restore a copy, or {_replacement(path, 'ca')}"
            if _made_by_init(path)
            else "Replace it by a PEM file",
        ) from error


def _made_by_init(path: Path) -> bool:
    """Whether `init` has created a file; another one may be a purchased certificate, which has to stay."""
    return path.name in _MADE_BY_INIT


def _replacement(certificate: Path, argument: str) -> str:
    """Returns how to replace a certificate of which nothing can be read, not even its hosts."""
    what, arguments = _REPLACEMENTS[argument]
    return f"{what}: {credentials_command(arguments, certificate.parent)}"


def _read_private(path: Path, name: str) -> bytes:
    content, status = _read(path, name)
    mode = stat.S_IMODE(status.st_mode)
    if status.st_uid not in {os.geteuid(), _ROOT}:
        raise UserError(
            f"the {name} {path} belongs to another user (id {status.st_uid}), who could replace it",
            f"Type: chown {os.geteuid()} {path}",
            exit_code=ExitCode.USAGE,
        )
    if mode & _OTHERS:
        raise UserError(
            f"other users have access to the {name} {path} (mode {mode:04o})",
            f"Type: chmod 600 {path}",
            exit_code=ExitCode.USAGE,
        )
    return content


def _read(path: Path, name: str) -> tuple[bytes, os.stat_result]:
    try:
        # The status is that of the opened file, which can't be exchanged between check and read.
        with path.open("rb") as file:
            status = os.fstat(file.fileno())
            content = file.read(_MAX_BYTES + 1)
    except OSError as error:
        raise UserError(
            f"the {name} {path} can't be read: {error.strerror}",
            _remedy(path, error),
            exit_code=ExitCode.USAGE,
        ) from error
    if len(content) > _MAX_BYTES:
        raise UserError(f"the {name} {path} is larger than 1 MiB", exit_code=ExitCode.USAGE)
    return content, status


def _remedy(path: Path, error: OSError) -> str:
    """Suggests `init` only for missing files that it creates: it must not replace a purchased certificate."""
    if isinstance(error, FileNotFoundError) and _made_by_init(path):
        return f"Type: {credentials_command('init', path.parent)}"
    return "Check its path and permissions: the gateway's user must be able to read it"
