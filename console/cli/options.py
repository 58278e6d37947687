"""The options that every command has, before or after its name."""

import functools
import inspect
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, TypeAlias

import typer

from common.errors import UserError
from console.cli.session import Session, standard_output
from console.client import DEFAULT_TARGET
from console.robots import choose, read_robots_file


def robot_names(incomplete: str) -> list[tuple[str, str]]:
    """Returns the completions of --robot: the names that begin so, each with its address."""
    try:
        robots = read_robots_file().robots
    except UserError:
        # An error message would break into the line being typed; the command itself reports it.
        return []
    return [(name, robot.target) for name, robot in robots.items() if name.startswith(incomplete)]


TargetOption: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--target",
        metavar="HOST:PORT",
        help=f"The robot's gateway; $ROBOTCTL_TARGET, a known robot or {DEFAULT_TARGET} when left out.",
        show_default=False,
    ),
]
RobotOption: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--robot",
        metavar="NAME",
        help="A robot that `robotctl robots` lists; $ROBOTCTL_ROBOT or the default one when left out.",
        show_default=False,
        autocompletion=robot_names,
    ),
]
JsonOption: TypeAlias = Annotated[
    bool, typer.Option("--json", help="Print JSON (docs/robotctl.md lists the keys).", show_default=False)
]


@dataclass(frozen=True, slots=True)
class GlobalOptions:
    """The options before the command's name."""

    target: str | None
    robot: str | None
    as_json: bool


def session_of(
    context: typer.Context, target: str | None = None, robot: str | None = None, as_json: bool = False
) -> Session:
    """Returns a session on standard output. An option after the command's name overrides one before it.

    Raises:
        UserError: No robot has this name, or the file of known robots is wrong.
    """
    before: GlobalOptions = context.obj
    chosen, name = choose(target or before.target, robot or before.robot, os.environ)
    return Session(chosen, json_requested(context, as_json), standard_output(), name)


def with_session(function: Callable[..., None]) -> Callable[..., None]:
    """Returns the command of a function: with --target, --robot and --json, which make its first argument.

    Args:
        function: Takes the `Session`, and the command's own arguments and options by name.
    """

    @functools.wraps(function, assigned=("__module__", "__name__", "__qualname__", "__doc__"))
    def command(
        context: typer.Context,
        target: TargetOption = None,
        robot: RobotOption = None,
        as_json: JsonOption = False,
        **own: Any,
    ) -> None:
        function(session_of(context, target, robot, as_json), **own)

    _, *own = inspect.signature(function).parameters.values()
    context, *shared, _ = inspect.signature(command, follow_wrapped=False).parameters.values()
    parameters = [each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in (context, *own, *shared)]
    # Typer reads options from these two.
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]  # of any callable
    command.__annotations__ = {each.name: each.annotation for each in parameters}
    return command


def json_requested(context: typer.Context, as_json: bool) -> bool:
    """Returns whether --json was given, before or after the command's name."""
    before: GlobalOptions = context.obj
    return as_json or before.as_json
