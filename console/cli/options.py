"""The options every command has, before or after its name."""

from dataclasses import dataclass
from typing import Annotated, TypeAlias

import typer

from common.errors import UserError
from console.cli.session import Session, open_session
from console.client.target import DEFAULT_TARGET
from console.robots import read_robots_file


def robot_names(incomplete: str) -> list[tuple[str, str]]:
    """What the shell offers after --robot: the names that begin so, each with its address."""
    try:
        robots = read_robots_file().robots
    except UserError:
        # A line in the middle of somebody's typing helps nobody; the command itself will say it.
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
class Said:
    """What stood before the command's name."""

    target: str | None
    robot: str | None
    as_json: bool


def remember(context: typer.Context, target: str | None, robot: str | None, as_json: bool) -> None:
    """Keeps what stood before the command's name."""
    context.obj = Said(target, robot, as_json)


def session_of(
    context: typer.Context, target: str | None, as_json: bool, robot: str | None = None
) -> Session:
    """The session: what stands after the command's name goes first.

    Raises:
        UserError: no robot has this name, or the file of known robots is wrong.
    """
    said: Said = context.obj
    return open_session(target or said.target, robot or said.robot, json_wanted(context, as_json))


def json_wanted(context: typer.Context, as_json: bool) -> bool:
    """Whether JSON was asked for, before or after the command's name."""
    said: Said = context.obj
    return as_json or said.as_json
