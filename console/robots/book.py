"""The file of known robots as values: ~/.config/robotctl/config.toml, read strictly.

    default = "lab2"

    [robots.lab2]
    target = "lab2.local:50051"
    ca_certificate_file = "credentials/lab2/ca.pem"
    token_file = "credentials/lab2/token"

Paths are relative to the file's own directory; `~` is the home directory.
"""

import os
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from common.errors import ExitCode, UserError
from console.client import parse_target

_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,62}")
_TOP_KEYS: Final = ("default", "robots")


@dataclass(frozen=True, slots=True, kw_only=True)
class Robot:
    """How one robot is reached. A field is a key of its table in the file.

    Args:
        target: HOST or HOST:PORT of its gateway.
        ca_certificate_file: who signed the gateway's certificate (PEM); with it the connection is encrypted.
        client_certificate_file: this person's certificate (PEM), where the robot asks for one.
        client_key_file: the key that belongs to it (PEM); nobody else may read it.
        token_file: this person's bearer token, on one line; nobody else may read it.
    """

    target: str
    ca_certificate_file: Path | None = None
    client_certificate_file: Path | None = None
    client_key_file: Path | None = None
    token_file: Path | None = None

    @property
    def guarded(self) -> bool:
        """Whether anything but the address is known: the connection must be encrypted."""
        return any(getattr(self, key) for key in FILE_KEYS)


KEYS: Final = tuple(one.name for one in fields(Robot))
FILE_KEYS: Final = KEYS[1:]


@dataclass(frozen=True, slots=True)
class RobotBook:
    """All known robots.

    Args:
        path: the file, whether it exists or not.
        robots: by name, in the file's order.
        default: the one that is meant when none is named.
    """

    path: Path
    robots: Mapping[str, Robot] = field(default_factory=lambda: MappingProxyType({}))
    default: str | None = None

    def find(self, name: str) -> Robot:
        """The robot of this name.

        Raises:
            UserError: there is none (a wrong command line).
        """
        try:
            return self.robots[name]
        except KeyError:
            known = ", ".join(self.robots) or "none"
            raise UserError(
                f"no robot is called '{name}' in {self.path} (known: {known})",
                f"Type: robotctl robots add {name} HOST:PORT",
                exit_code=ExitCode.USAGE,
            ) from None


def book_path() -> Path:
    """$XDG_CONFIG_HOME/robotctl/config.toml; ~/.config when that is not set, or not an absolute path."""
    configured = Path(os.environ.get("XDG_CONFIG_HOME", ""))
    home = configured if configured.is_absolute() else Path.home() / ".config"
    return home / "robotctl" / "config.toml"


def read_book(path: Path | None = None) -> RobotBook:
    """The file, or an empty book where there is none.

    Raises:
        UserError: it can't be read, is no TOML, or says something that is not known.
    """
    path = path or book_path()
    try:
        return parse_book(path, path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return RobotBook(path)
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise UserError(
            f"{path} can't be read: {reason}",
            "Mend the file, or name the robot with --target",
            exit_code=ExitCode.USAGE,
        ) from error


def parse_book(path: Path, text: str) -> RobotBook:
    """The book that a text makes.

    Raises:
        UserError: as `read_book`; the line names the file, the key and what is allowed.
    """
    try:
        document = tomllib.loads(text)
    # Beside its own error, which is a ValueError, the parser lets through what endless nesting raises.
    except (ValueError, RecursionError) as error:
        raise _wrong(path, f"not TOML: {error}", "") from error
    _only(path, "", document, _TOP_KEYS)
    tables = document.get("robots", {})
    if not isinstance(tables, dict):
        raise _wrong(path, "'robots' is not a table", "Write [robots.NAME] above a robot's keys")
    robots = {name: _robot(path, name, table) for name, table in tables.items()}
    default = document.get("default")
    if default is not None and not (isinstance(default, str) and default in robots):
        known = ", ".join(robots) or "none"
        raise _wrong(path, f"default = {default!r} is not one of its robots", f"Known: {known}")
    return RobotBook(path, MappingProxyType(robots), default)


def check_name(name: str) -> str:
    """The name, if a robot may be called so.

    Raises:
        UserError: it may not (a wrong command line).
    """
    if not _NAME.fullmatch(name):
        raise UserError(
            f"'{name}' can't be a robot's name",
            "Take up to 63 letters, digits, - and _, the first a letter or a digit",
            exit_code=ExitCode.USAGE,
        )
    return name


def _robot(path: Path, name: str, table: Any) -> Robot:
    where = f"robots.{name}"
    if not _NAME.fullmatch(name):
        raise _wrong(path, f"'{name}' can't be a robot's name", "Allowed: letters, digits, - and _")
    if not isinstance(table, dict):
        raise _wrong(path, f"'{where}' is not a table", f"Write [{where}] above the robot's keys")
    _only(path, f"{where}.", table, KEYS)
    if "target" not in table:
        raise _wrong(path, f"{where} has no target", 'Write: target = "HOST:PORT"')
    for key, value in table.items():
        if not isinstance(value, str) or not value.strip():
            raise _wrong(path, f"{where}.{key} = {value!r} is not a text", f'Write: {key} = "..."')
    try:
        target = parse_target(table["target"])
    except UserError as error:
        raise _wrong(path, f"{where}.target: {error.what}", error.remedy) from error
    if ("client_certificate_file" in table) != ("client_key_file" in table):
        raise _wrong(
            path,
            f"{where} has one of client_certificate_file and client_key_file",
            "They belong together: write both",
        )
    return Robot(target=target, **{key: _file(path, table[key]) for key in FILE_KEYS if key in table})


def _file(book: Path, text: str) -> Path:
    try:
        given = Path(text).expanduser()
    except RuntimeError as error:
        raise _wrong(book, f"'{text}': {error}", "Write the whole path") from error
    return book.parent / given


def _only(path: Path, above: str, table: Mapping[str, Any], allowed: tuple[str, ...]) -> None:
    for key in table:
        if key not in allowed:
            raise _wrong(path, f"unknown key '{above}{key}'", f"Allowed: {', '.join(allowed)}")


def _wrong(path: Path, what: str, remedy: str) -> UserError:
    return UserError(f"{path}: {what}", remedy, exit_code=ExitCode.USAGE)
