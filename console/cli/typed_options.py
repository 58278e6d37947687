"""Commands in errors and findings name the same robot as the command line that they answer."""

import os
import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from common.errors import UserError
from console.robots import choose
from console.target import parse_target

_OPTIONS: Final = ("--target", "--robot")
_ASKING: Final = re.compile(
    r"\brobotctl (?=(?:status|watch|overlay|events|info|doctor|preview|stop|reset-stop|drive|record|view"
    r"|monitor|record)\b)"
)
_LOGIN: Final = re.compile(r"(?<=\brobotctl login )NAME HOST:PORT\b")


@dataclass(frozen=True, slots=True)
class TypedOptions:
    """What a command line says of its robot.

    Args:
        target: Value of --target.
        robot: Value of --robot.
        command: Name of the command; empty where there is none.
        arguments: The command's own words that are no options.
    """

    target: str | None
    robot: str | None
    command: str
    arguments: tuple[str, ...]

    @property
    def words(self) -> str:
        """The options as they are typed, each with a blank before it; empty where there are none."""
        given = {"--target": self.target, "--robot": self.robot}
        return "".join(f" {name} {shlex.quote(value)}" for name, value in given.items() if value)

    def repeated_in(self, text: str) -> str:
        """Returns a text whose commands for a robot have these options, and whose logins have its name."""
        text = _ASKING.sub(lambda _: f"robotctl{self.words} ", text)
        return _LOGIN.sub(lambda _: self._login(), text)

    def _login(self) -> str:
        """Returns name and address for a login; placeholders for those that are not known."""
        if self.command == "login" and len(self.arguments) >= 2:
            return shlex.join(self.arguments[:2])
        try:
            robot, name = choose(self.target, self.robot, os.environ)
            target = parse_target(robot.target)
        except UserError:
            return "NAME HOST:PORT"
        return f"{name or 'NAME'} {target}"


def typed_options(words: Sequence[str]) -> TypedOptions:
    """Returns the options of a command line, whether it is right or not; the last of repeated ones."""
    values: dict[str, str | None] = dict.fromkeys(_OPTIONS)
    others: list[str] = []
    rest = iter(words)
    for word in rest:
        name, equals, value = word.partition("=")
        if name in _OPTIONS:
            values[name] = value if equals else next(rest, None)
        elif not word.startswith("-"):
            others.append(word)
    command, *arguments = others or [""]
    return TypedOptions(values["--target"], values["--robot"], command, tuple(arguments))
