"""Changes to the file of known robots: only the lines that must change, so that a person's comments stay."""

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Final, TypeAlias

from common.errors import UserError
from common.private_files import directory_lock, write_private
from console.client import parse_target
from console.robots.book import (
    FILE_KEYS,
    KEYS,
    Robot,
    RobotBook,
    book_path,
    check_name,
    parse_book,
    read_book,
)

Lines: TypeAlias = list[str]
Edit: TypeAlias = Callable[[Lines], Lines]
_HEADER: Final = re.compile(r"\s*\[")
_DEFAULT: Final = re.compile(r"\s*default\s*=")
_KEY: Final = re.compile(r"\s*(" + "|".join(KEYS) + r")\s*=")


def put_robot(name: str, robot: Robot, *, path: Path | None = None) -> RobotBook:
    """Writes a robot's entry: a new one at the end of the file, or a known one's anew.

    The first robot of a file becomes its default.

    Args:
        name: what people will call it.
        robot: its entry; paths in it are absolute.
        path: another file than this person's own.

    Raises:
        UserError: the name or the address won't do, or the file is wrong or can't be written.
    """
    check_name(name)
    robot = replace(robot, target=parse_target(robot.target))

    def change(book: RobotBook) -> tuple[RobotBook, Edit]:
        default = book.default if book.robots else name
        wanted = replace(book, robots=_frozen({**book.robots, name: robot}), default=default)

        def edit(lines: Lines) -> Lines:
            lines = _with_entry(lines, name, robot, book.path.parent)
            return lines if default == book.default else _with_default(lines, default)

        return wanted, edit

    return _change(path, change)


def drop_robot(name: str, *, path: Path | None = None) -> RobotBook:
    """Takes a robot out of the file; if it was the default, there is none any more.

    Raises:
        UserError: no robot has this name, or as `put_robot`.
    """

    def change(book: RobotBook) -> tuple[RobotBook, Edit]:
        book.find(name)
        left = {other: robot for other, robot in book.robots.items() if other != name}
        default = None if book.default == name else book.default

        def edit(lines: Lines) -> Lines:
            begin, end = _place(lines, name)
            lines = lines[:begin] + lines[end:]
            return lines if default == book.default else _with_default(lines, default)

        return replace(book, robots=_frozen(left), default=default), edit

    return _change(path, change)


def set_default(name: str, *, path: Path | None = None) -> RobotBook:
    """Makes a known robot the one that is meant when none is named.

    Raises:
        UserError: as `drop_robot`.
    """

    def change(book: RobotBook) -> tuple[RobotBook, Edit]:
        book.find(name)
        return replace(book, default=name), lambda lines: _with_default(lines, name)

    return _change(path, change)


def _change(path: Path | None, change: Callable[[RobotBook], tuple[RobotBook, Edit]]) -> RobotBook:
    path = path or book_path()
    with directory_lock(path.parent):
        wanted, edit = change(read_book(path))
        before = path.read_text(encoding="utf-8") if path.exists() else ""
        after = "\n".join(edit(before.splitlines())).strip("\n") + "\n"
        if not _means(path, after, wanted):
            raise UserError(
                f"{path} is written in a way that robotctl can't change",
                "Give each robot a table [robots.NAME] of its own, or change it with an editor",
            )
        if after != before:
            write_private(path, after.encode())
    return wanted


def _means(path: Path, text: str, wanted: RobotBook) -> bool:
    # TOML can be written in more ways than these edits know: what comes out is what was meant, or nothing.
    try:
        return parse_book(path, text) == wanted
    except UserError:
        return False


def _frozen(robots: dict[str, Robot]) -> Mapping[str, Robot]:
    return MappingProxyType(robots)


def _with_entry(lines: Lines, name: str, robot: Robot, directory: Path) -> Lines:
    entry = [f"target = {_text(robot.target)}"]
    files = {key: path for key in FILE_KEYS if (path := getattr(robot, key))}
    entry += [f"{key} = {_text(_short(path, directory))}" for key, path in files.items()]
    begin, end = _place(lines, name)
    if begin == end:
        gap = [""] if lines and lines[-1].strip() else []
        return [*lines, *gap, f"[robots.{name}]", *entry]
    kept = [line for line in lines[begin + 1 : end] if not _KEY.match(line)]
    return [*lines[: begin + 1], *entry, *kept, *lines[end:]]


def _with_default(lines: Lines, name: str | None) -> Lines:
    first_table = next((at for at, line in enumerate(lines) if _HEADER.match(line)), len(lines))
    top = [line for line in lines[:first_table] if not _DEFAULT.match(line)]
    if name is None:
        return top + lines[first_table:]
    while top and not top[-1].strip():
        top.pop()
    return [*top, f"default = {_text(name)}", "", *lines[first_table:]]


def _place(lines: Lines, name: str) -> tuple[int, int]:
    """Where a robot's table begins, and where the next one does; twice the end when it has none."""
    header = re.compile(rf"""\s*\[\s*robots\s*\.\s*(["']?){re.escape(name)}\1\s*\]""")
    begin = next((at for at, line in enumerate(lines) if header.match(line)), len(lines))
    after = range(begin + 1, len(lines))
    end = next((at for at in after if _HEADER.match(lines[at])), len(lines))
    # Comments right above the next table belong to that one.
    while end < len(lines) and end - 1 > begin and lines[end - 1].lstrip().startswith("#"):
        end -= 1
    return begin, end


def _short(path: Path, directory: Path) -> str:
    return str(path.relative_to(directory) if path.is_relative_to(directory) else path)


def _text(value: str) -> str:
    # A JSON string is a TOML basic string, but for DEL, which TOML wants escaped.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
