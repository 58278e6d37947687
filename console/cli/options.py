"""The options that several commands have; the first three before or after the command's name."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeAlias

import typer

from common.errors import UserError
from console.robots import read_robots_file
from console.target import DEFAULT_TARGET


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
CountOption: TypeAlias = Annotated[
    int | None,
    typer.Option("--count", min=1, help="End after so many updates.", show_default="until Ctrl-C"),
]
FollowOption: TypeAlias = Annotated[
    bool, typer.Option("--follow", help="Continue with new events until Ctrl-C.", show_default=False)
]
SeverityOption: TypeAlias = Annotated[
    Literal["info", "warning", "error"],
    typer.Option("--severity", help="Leave out events of lower severity."),
]
ClientsOption: TypeAlias = Annotated[
    bool, typer.Option("--clients", help="Show who joins and leaves, too.", show_default=False)
]


def interval_option(least_s: float) -> Any:
    """Returns the option for the shortest time between updates, in seconds."""
    return typer.Option(
        "--interval", min=least_s, max=3600, metavar="SECONDS", help="Shortest time between updates."
    )


@dataclass(frozen=True, slots=True)
class GlobalOptions:
    """The options before the command's name."""

    target: str | None
    robot: str | None
    as_json: bool


def json_requested(context: typer.Context, as_json: bool) -> bool:
    """Returns whether --json was given, before or after the command's name."""
    before: GlobalOptions = context.obj
    return as_json or before.as_json
