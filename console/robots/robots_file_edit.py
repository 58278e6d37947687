"""Edits of the file of known robots, with its comments and layout kept."""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from common.errors import UserError
from common.private_files import directory_lock, write_private
from console.robots.robots_file import (
    FILE_KEYS,
    Robot,
    RobotsFile,
    check_name,
    parse_robots_file,
    read_robots_file,
    read_text,
    robots_file_path,
)
from console.target import parse_target

if TYPE_CHECKING:
    from tomlkit import TOMLDocument

NO_FILES: Final[Mapping[Path, bytes]] = {}
_FILE: Final = r"((ca|client|client-key)(-[0-9a-f]+)?\.pem|token(-[0-9a-f]+)?)"
"""A name of a file of a login (login.py); those of earlier releases have no mark."""
_OF_A_LOGIN: Final = re.compile(rf"{_FILE}|\.{_FILE}\.\w+")
"""The same, or what an interruption left of one (common/private_files.py)."""


def put_robot(
    name: str, robot: Robot, *, path: Path | None = None, contents: Mapping[Path, bytes] = NO_FILES
) -> RobotsFile:
    """Adds a robot at the end of the file, or changes its entry. The first robot becomes the default.

    Args:
        name: Its name.
        robot: Its entry; paths in it are absolute.
        path: Another file than this user's own.
        contents: Of files that the entry names and none did before, in a directory that robotctl keeps. They
            are written before it, and only if it can be written; then those are deleted there that no entry
            names. So the entry decides: an interruption leaves it as it was, with the files that it had, or
            as it is to be.

    Raises:
        UserError: The name or the address is not allowed, or the file is wrong or can't be written.
        OSError: A file that no entry names can't be deleted.
    """
    import tomlkit  # noqa: PLC0415 - see _edit

    check_name(name)
    robot = replace(robot, target=parse_target(robot.target))

    def edit(before: RobotsFile, document: "TOMLDocument") -> RobotsFile:
        robots: Any = document.setdefault("robots", {})
        if name not in robots:
            robots[name] = tomlkit.table()
        _hand_over_comments(robots, name)
        _set_keys(robots[name], robot, before.path.parent)
        default = before.default
        if not before.robots:
            default = document["default"] = name
        return replace(before, robots={**before.robots, name: robot}, default=default)

    return _edit(path, edit, contents)


def drop_robot(name: str, *, path: Path | None = None) -> RobotsFile:
    """Removes a robot; if it was the default, there is none afterwards.

    Raises:
        UserError: No robot has this name, or as `put_robot`.
    """

    def edit(before: RobotsFile, document: "TOMLDocument") -> RobotsFile:
        before.find(name)
        robots: Any = document["robots"]
        _hand_over_comments(robots, name)
        del robots[name]
        default = before.default
        if default == name:
            default = None
            del document["default"]
        left = {other: robot for other, robot in before.robots.items() if other != name}
        return replace(before, robots=left, default=default)

    return _edit(path, edit)


def set_default(name: str, *, path: Path | None = None) -> RobotsFile:
    """Makes a known robot the default.

    Raises:
        UserError: As `drop_robot`.
    """

    def edit(before: RobotsFile, document: "TOMLDocument") -> RobotsFile:
        before.find(name)
        document["default"] = name
        return replace(before, default=name)

    return _edit(path, edit)


def _edit(
    path: Path | None,
    edit: Callable[[RobotsFile, "TOMLDocument"], RobotsFile],
    contents: Mapping[Path, bytes] = NO_FILES,
) -> RobotsFile:
    import tomlkit  # noqa: PLC0415 - takes 50 ms, which commands that edit nothing need not spend

    path = path or robots_file_path()
    with directory_lock(path.parent):
        text = read_text(path)
        before = parse_robots_file(path, text)
        try:
            document = tomlkit.parse(text)
            wanted = edit(before, document)
            edited = tomlkit.dumps(document).strip("\n") + "\n"
        except (tomlkit.exceptions.TOMLKitError, ValueError) as error:
            raise _not_editable(path) from error
        # TOML has more notations than can be edited in place: the result is what was meant, or nothing.
        if not _means(path, edited, wanted):
            raise _not_editable(path)
        try:
            for file, content in contents.items():
                write_private(file, content)
            if edited != text:
                write_private(path, edited.encode())
        finally:
            # After an interruption these are the new ones. Where it does not happen, the next login does it.
            for directory in {file.parent for file in contents}:
                _delete_unnamed(directory, read_robots_file(path))
    return wanted


def _delete_unnamed(directory: Path, known: RobotsFile) -> None:
    """Deletes the logins' files of a directory that no robot's entry names; a person's own stay."""
    files = (getattr(robot, key) for robot in known.robots.values() for key in FILE_KEYS)
    named = {file.resolve() for file in files if file}
    for file in directory.glob("*"):
        if _OF_A_LOGIN.fullmatch(file.name) and file.is_file() and file.resolve() not in named:
            file.unlink(missing_ok=True)


def _means(path: Path, text: str, wanted: RobotsFile) -> bool:
    try:
        return parse_robots_file(path, text) == wanted
    except UserError:
        return False


def _not_editable(path: Path) -> UserError:
    return UserError(
        f"{path} is written in a way that robotctl can't change",
        "Give each robot a table [robots.NAME] of its own, or change it with an editor",
    )


def _set_keys(entry: Any, robot: Robot, directory: Path) -> None:
    """Gives an entry the keys of a robot; what stays keeps its place and the comment behind it."""
    body = entry.value.body
    blank = [body.pop() for _ in takewhile(lambda each: each[0] is None, reversed(tuple(body)))]
    entry["target"] = robot.target
    for key in FILE_KEYS:
        if file := getattr(robot, key):
            entry[key] = str(file.relative_to(directory) if file.is_relative_to(directory) else file)
        elif key in entry:
            del entry[key]
    # Comments and blank lines at its end stay there.
    body.extend(reversed(blank))


def _hand_over_comments(robots: Any, name: str) -> None:
    """Moves the comments right above the next table, which TOML Kit counts to this one, to the next one."""
    names = list(robots)
    after = names[names.index(name) + 1 :]
    if not after:
        return
    body, following = robots[name].value.body, robots[after[0]].trivia
    while body and body[-1][1].as_string().startswith("#"):
        following.indent = body.pop()[1].as_string() + following.indent
