"""Command lines: values read without pydantic, and mistakes as one line.

Typer checks each value by pydantic, whose import takes as long as a whole status, and whose sentences are
for programmers. The few types that the programs have are read here instead.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from difflib import get_close_matches
from enum import Enum
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import typer
from typer.core import TyperGroup

from common.errors import ExitCode, UserError


def usage_error(error: typer.TyperException, name: str, options: str = "") -> UserError:
    """Returns the error of a wrong command line: what is wrong, and what was probably meant.

    Args:
        error: Of Typer.
        name: Of the program.
        options: Those of the command line that its repetition needs, " --robot lab2" for example.
    """
    context = getattr(error, "ctx", None)
    path = context.command_path if context else name
    remedy = f"Type: {name}{options}{path.removeprefix(name)} --help"
    message = error.format_message().removesuffix(".")
    if possible := getattr(error, "possibilities", None):
        message = f"{getattr(error, 'message', message)}. Did you mean {' or '.join(sorted(possible))}?"
    # A group without a command has printed its help.
    return UserError(message or "no command is given", remedy, exit_code=ExitCode.USAGE)


def read_plainly(command: Any) -> None:
    """Reads the parameters of a command, and of all commands of a group, by `PlainValue`."""
    for parameter in command.get_params(typer.Context(command)):  # with --help, which is none of its `params`
        # Typer makes its own reader when the first value comes, unless there is one already.
        parameter._runtime_param = PlainValue(parameter.type_descriptor)  # no public way
    if isinstance(command, TyperGroup):
        for each in command.commands.values():
            read_plainly(each)


@dataclass(frozen=True, slots=True)
class PlainValue:
    """Reads the value of one parameter: a text, a number in a range, a path or one of several words.

    Args:
        descriptor: Typer's, with the parameter's type and range.
    """

    descriptor: Any

    def coerce(self, value: Any, param: Any, ctx: Any) -> Any:
        """Returns the value in the parameter's type (Typer's protocol); None if it was not given.

        Raises:
            typer.BadParameter: It is none of them; the message says what is expected.
        """
        kind = self.descriptor.annotation
        if value is None:
            return () if get_origin(kind) is list else None
        if kind in (str, Path) or get_origin(kind) is list or isinstance(value, bool):
            return Path(value) if kind is Path else value
        if kind in (int, float):
            return self._number(kind, value, param, ctx)
        if kind is datetime:
            return self._time(value, param, ctx)
        if isinstance(kind, type) and issubclass(kind, Enum):
            words = [str(member.value) for member in kind]
            return value if isinstance(value, kind) else kind(self._word(value, words, param, ctx))
        if kind is bool:  # of an environment variable: on the command line a flag has no value
            kind = Literal["true", "false"]
        word = self._word(value, get_args(kind), param, ctx)
        return word == "true" if self.descriptor.annotation is bool else word

    def _word(self, value: Any, words: Sequence[str], param: Any, ctx: Any) -> Any:
        # low_bw and LOW_BW are low-bw to people.
        if (plain := str(value).lower().replace("_", "-")) in words:
            return plain
        if value in words:
            return value
        meant = get_close_matches(plain, words, n=1)
        hint = f". Did you mean {meant[0]}?" if meant else ""
        raise typer.BadParameter(f"'{value}' is not one of {', '.join(words)}{hint}", ctx=ctx, param=param)

    def _number(self, kind: type[int] | type[float], value: Any, param: Any, ctx: Any) -> int | float:
        least, most = self.descriptor.parameter_info.min, self.descriptor.parameter_info.max
        noun = "a whole number" if kind is int else "a number"
        limits = f" from {least:.15g} to {most:.15g}" if most is not None else f" of at least {least:.15g}"
        try:
            number = kind(value)
        except ValueError:
            number = None
        # Not "outside": a NaN is neither above nor below anything.
        if number is None or not (least <= number and (most is None or number <= most)):
            raise typer.BadParameter(f"'{value}' is not {noun}{limits}", ctx=ctx, param=param)
        return number

    def _time(self, value: Any, param: Any, ctx: Any) -> datetime:
        try:
            instant = value if isinstance(value, datetime) else datetime.fromisoformat(value)
        except ValueError:
            instant = None
        if instant is None or instant.tzinfo:
            what = f"'{value}' is not a time in UTC, 2026-11-22 or 2026-11-22T09:30 for example"
            raise typer.BadParameter(what, ctx=ctx, param=param)
        return instant
