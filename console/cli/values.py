"""The values of options and arguments, read without pydantic.

Typer checks each value by pydantic, whose import takes as long as a whole status, and whose sentences are
for programmers. The few types that robotctl has are read here instead.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, get_args

import typer
from typer.core import TyperGroup


def read_plainly(command: Any) -> None:
    """Has the parameters of a command, and of all commands of a group, read by `PlainValue`."""
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
        if value is None or kind in (str, bool):
            return value
        if kind is Path:
            return Path(value)
        if kind in (int, float):
            return self._number(kind, value, param, ctx)
        if isinstance(kind, type) and issubclass(kind, Enum):
            words = [str(member.value) for member in kind]
            return value if isinstance(value, kind) else kind(self._word(value, words, param, ctx))
        return self._word(value, get_args(kind), param, ctx)

    def _word(self, value: Any, words: Sequence[str], param: Any, ctx: Any) -> Any:
        if value in words:
            return value
        raise typer.BadParameter(f"'{value}' is not one of {', '.join(words)}", ctx=ctx, param=param)

    def _number(self, kind: type[int] | type[float], value: Any, param: Any, ctx: Any) -> int | float:
        least, most = self.descriptor.parameter_info.min, self.descriptor.parameter_info.max
        noun = "a whole number" if kind is int else "a number"
        limits = f" from {least:g} to {most:g}" if most is not None else f" of at least {least:g}"
        try:
            number = kind(value)
        except ValueError:
            number = None
        # Not "outside": a NaN is neither above nor below anything.
        if number is None or not (least <= number and (most is None or number <= most)):
            raise typer.BadParameter(f"'{value}' is not {noun}{limits}", ctx=ctx, param=param)
        return number
