"""Edits of the file of known robots, with its comments and layout kept."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from common.errors import UserError
from common.private_files import directory_lock, write_private
from console.client import parse_target
from console.robots.robots_file import (
    FILE_KEYS,
    Robot,
    RobotsFile,
    check_name,
    parse_robots_file,
    read_text,
    robots_file_path,
)

if TYPE_CHECKING:
    from tomlkit import TOMLDocument
    from tomlkit.items import Table


def put_robot(name: str, robot: Robot, *, path: Path | None = None) -> RobotsFile:
    """Adds a robot at the end of the file, or replaces its entry. The first robot becomes the default.

    Args:
        name: Its name.
        robot: Its entry; paths in it are absolute.
        path: Another file than this user's own.

    Raises:
        UserError: The name or the address is not allowed, or the file is wrong or can't be written.
    """
    check_name(name)
    robot = replace(robot, target=parse_target(robot.target))

    def edit(before: RobotsFile, document: "TOMLDocument") -> RobotsFile:
        robots: Any = document.setdefault("robots", {})
        if name in robots:
            _hand_over_comments(robots, name)
        robots[name] = _entry(robot, before.path.parent, robots.get(name))
        default = before.default
        if not before.robots:
            default = document["default"] = name
        return replace(before, robots=MappingProxyType({**before.robots, name: robot}), default=default)

    return _edit(path, edit)


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
        return replace(before, robots=MappingProxyType(left), default=default)

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


def _edit(path: Path | None, edit: Callable[[RobotsFile, "TOMLDocument"], RobotsFile]) -> RobotsFile:
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
        if edited != text:
            write_private(path, edited.encode())
    return wanted


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


def _entry(robot: Robot, directory: Path, old: Any) -> "Table":
    import tomlkit  # noqa: PLC0415 - see _edit

    entry = tomlkit.table()
    entry.add("target", robot.target)
    for key in FILE_KEYS:
        if file := getattr(robot, key):
            entry.add(key, str(file.relative_to(directory) if file.is_relative_to(directory) else file))
    if old is not None:
        # Comments and blank lines.
        for key, item in old.value.body:
            if key is None:
                entry.add(item)
    return entry


def _hand_over_comments(robots: Any, name: str) -> None:
    """Moves the comments right above the next table, which TOML Kit counts to this one, to the next one."""
    names = list(robots)
    after = names[names.index(name) + 1 :]
    if not after:
        return
    body, following = robots[name].value.body, robots[after[0]].trivia
    while body and body[-1][1].as_string().startswith("#"):
        following.indent = body.pop()[1].as_string() + following.indent
