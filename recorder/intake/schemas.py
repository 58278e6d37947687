"""Definitions of message types as MCAP keeps them ("ros2msg"), from the .msg files of installed packages."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from common.ros_node import TypeMissingError, share_directory

ENCODING: Final = "ros2msg"
TYPE: Final = re.compile(r"[a-z][a-z0-9_]{0,127}/msg/[A-Z][A-Za-z0-9]{0,127}")
"""Names of message types (ROS 2, "Interfaces"). Those of services and actions have no file of their own."""
_SEPARATOR: Final = "=" * 80
"""Between definitions (MCAP registry, "ros2msg"); then a line with "MSG: " and the type's name."""
_PRIMITIVES: Final = frozenset(
    (
        *("bool", "byte", "char", "float32", "float64", "string", "wstring"),
        *("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64"),
    )
)
_FIELD: Final = re.compile(r"\s*([A-Za-z][\w/]*)(?:<=\d+)?(?:\[(?:<=)?\d*\])?\s+[A-Za-z]")
_MAX_TYPES: Final = 1000
"""Definitions of one type and all that it contains."""


class Schemas:
    """Reads each definition once."""

    def __init__(self) -> None:
        self._known: dict[str, bytes] = {}

    def of(self, type_name: str) -> bytes:
        """Returns the definition of "package/msg/Name" and of all types that it contains.

        Raises:
            TypeMissingError: one of them is not installed, or has no readable definition.
        """
        if type_name not in self._known:
            self._known[type_name] = _schema(type_name)
        return self._known[type_name]


def _schema(type_name: str) -> bytes:
    texts: dict[str, str] = {}
    waiting = [type_name]
    while waiting:
        name = waiting.pop(0)
        if name in texts:
            continue
        if len(texts) >= _MAX_TYPES:
            raise TypeMissingError(f"message type {type_name} contains more than {_MAX_TYPES} types")
        texts[name] = _definition(name)
        waiting += _contained(texts[name], name.partition("/")[0])
    first, *others = texts.items()
    parts = [first[1], *(f"{_SEPARATOR}\nMSG: {_short(name)}\n{text}" for name, text in others)]
    return "\n".join(part.rstrip("\n") for part in parts).encode() + b"\n"


def _definition(type_name: str) -> str:
    if not TYPE.fullmatch(type_name):
        raise TypeMissingError(f"{type_name!r} is no message type")
    package, _, name = type_name.split("/")
    share = share_directory(package)
    if share is None:
        raise TypeMissingError(
            f"message type {type_name} is not installed. "
            f"Type: apt install ros-$ROS_DISTRO-{package.replace('_', '-')}"
        )
    file = share / "msg" / f"{name}.msg"
    if not file.is_file():
        raise TypeMissingError(f"the installed package {package} has no message {name}")
    return _text(file)


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise TypeMissingError(f"{file} can't be read: {error}") from error


def _contained(text: str, package: str) -> Iterator[str]:
    for line in text.splitlines():
        found = _FIELD.match(line.partition("#")[0])
        if found and found[1] not in _PRIMITIVES:
            yield _full(found[1], package)


def _full(name: str, package: str) -> str:
    """Returns "package/msg/Name" of a type as a definition names it: "Name" or "package/Name"."""
    owner, _, short = name.rpartition("/")
    return f"{owner.removesuffix('/msg') or package}/msg/{short}"


def _short(type_name: str) -> str:
    package, _, name = type_name.split("/")
    return f"{package}/{name}"
