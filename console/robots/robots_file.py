"""The file of known robots: ~/.config/robotctl/config.toml, read strictly.

    default = "lab2"

    [robots.lab2]
    target = "lab2.local:50051"
    ca_certificate_file = "credentials/lab2/ca-5f3a9c1e.pem"
    token_file = "credentials/lab2/token-5f3a9c1e"

Paths are relative to the file's own directory; `~` is the home directory.
"""

import os
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Final

from common.errors import ExitCode, UserError
from console.target import parse_target

_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,62}")
_TOP_KEYS: Final = ("default", "robots")


@dataclass(frozen=True, slots=True, kw_only=True)
class Robot:
    """How to reach one robot. Each field is a key of its table in the file.

    Args:
        target: HOST or HOST:PORT of its gateway.
        ca_certificate_file: Certificate of the authority that signed the gateway's certificate (PEM); with it
            the connection is encrypted.
        client_certificate_file: This user's certificate (PEM), for a robot that requires one.
        client_key_file: The private key of that certificate (PEM), readable by its owner only.
        token_file: This user's bearer token, on one line, readable by its owner only.
    """

    target: str
    ca_certificate_file: Path | None = None
    client_certificate_file: Path | None = None
    client_key_file: Path | None = None
    token_file: Path | None = None


KEYS: Final = tuple(one.name for one in fields(Robot))
FILE_KEYS: Final = KEYS[1:]


@dataclass(frozen=True, slots=True)
class RobotsFile:
    """The content of the file.

    Args:
        path: The file, whether it exists or not.
        robots: By name, in the file's order.
        default: The robot that commands use when none is named.
    """

    path: Path
    robots: Mapping[str, Robot] = field(default_factory=dict)
    default: str | None = None

    def find(self, name: str) -> Robot:
        """Returns the robot of this name.

        Raises:
            UserError: There is none (a wrong command line).
        """
        try:
            return self.robots[name]
        except KeyError:
            known = ", ".join(self.robots) or "none"
            meant = get_close_matches(name, self.robots, n=1)
            raise UserError(
                f"no robot is called '{name}' in {self.path} (known: {known})",
                f"Did you mean '{meant[0]}'?" if meant else f"Type: robotctl robots add {name} HOST:PORT",
                exit_code=ExitCode.USAGE,
            ) from None


def robots_file_path() -> Path:
    """Returns $XDG_CONFIG_HOME/robotctl/config.toml; ~/.config where that is unset or not absolute."""
    configured = Path(os.environ.get("XDG_CONFIG_HOME", ""))
    home = configured if configured.is_absolute() else Path.home() / ".config"
    return home / "robotctl" / "config.toml"


def read_robots_file(path: Path | None = None) -> RobotsFile:
    """Returns the content of this user's file, empty where there is none.

    Raises:
        UserError: It can't be read, is not TOML, or has an unknown key or a wrong value.
    """
    path = path or robots_file_path()
    return parse_robots_file(path, read_text(path))


def parse_robots_file(path: Path, text: str) -> RobotsFile:
    """Returns the content of a text.

    Raises:
        UserError: As `read_robots_file`; the line names the file, the key and the allowed values.
    """
    try:
        document = tomllib.loads(text)
    # Beside its own error, which is a ValueError, the parser passes on what endless nesting raises.
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
    return RobotsFile(path, robots, default)


def check_name(name: str) -> str:
    """Returns the name of a robot.

    Raises:
        UserError: It is not allowed (a wrong command line).
    """
    if not _NAME.fullmatch(name):
        raise UserError(
            f"'{name}' can't be a robot's name",
            "Use up to 63 letters, digits, - and _, the first a letter or a digit",
            exit_code=ExitCode.USAGE,
        )
    return name


def read_text(path: Path) -> str:
    """Returns the text of the file, empty where there is none; raises as `read_robots_file`."""
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return ""
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise UserError(
            f"{path} can't be read: {reason}",
            "Correct the file, or use the robot's address instead of its name",
            exit_code=ExitCode.USAGE,
        ) from error


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


def _file(path: Path, text: str) -> Path:
    try:
        given = Path(text).expanduser()
    except RuntimeError as error:
        raise _wrong(path, f"'{text}': {error}", "Write the whole path") from error
    return path.parent / given


def _only(path: Path, above: str, table: Mapping[str, Any], allowed: tuple[str, ...]) -> None:
    for key in table:
        if key not in allowed:
            meant = get_close_matches(key, allowed, n=1)
            hint = f"Did you mean '{meant[0]}'? " if meant else ""
            raise _wrong(path, f"unknown key '{above}{key}'", f"{hint}Allowed: {', '.join(allowed)}")


def _wrong(path: Path, what: str, remedy: str) -> UserError:
    return UserError(f"{path}: {what}", remedy, exit_code=ExitCode.USAGE)
