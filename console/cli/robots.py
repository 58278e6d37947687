"""robotctl robots: lists, adds and removes robots known by name."""

import sys
from dataclasses import replace
from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from common.errors import UserError
from console.cli.options import JsonOption, json_requested, robot_names
from console.cli.session import print_json, standard_output
from console.cli.tables import grid
from console.robots import Robot, RobotsFile, read_robots_file
from console.robots.credentials import forget_credentials
from console.robots.robots_file import FILE_KEYS
from console.robots.robots_file_edit import drop_robot, put_robot, set_default
from console.target import parse_target

robots_app = typer.Typer(
    help="List the robots known by name, or change the list.", add_completion=False, rich_markup_mode=None
)

NameArgument = Annotated[
    str, typer.Argument(metavar="NAME", help="The robot's name.", autocompletion=robot_names)
]


@robots_app.callback(invoke_without_command=True)
def robots(context: typer.Context, as_json: JsonOption = False) -> None:
    """List the robots known by name, or change the list."""
    if context.invoked_subcommand is None:
        _show(context, read_robots_file(), as_json)
    elif as_json:
        context.obj = replace(context.obj, as_json=True)


@robots_app.command("add")
def add(
    context: typer.Context,
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name to store it under; --robot selects it.")],
    target: Annotated[str, typer.Argument(metavar="HOST:PORT", help="Address of its gateway.")],
    new_address: Annotated[
        bool, typer.Option("--replace", help="Change the address of a known robot; its login stays.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Give a robot a name. The first one becomes the default."""
    known = read_robots_file().robots.get(name)
    entry = replace(known, target=target) if known else Robot(target=target)
    if known and not new_address and known.target != parse_target(target):
        raise UserError(
            f"'{name}' is known already, at {known.target}",
            f"Type: robotctl robots add {name} {target} --replace",
        )
    _show(context, put_robot(name, entry), as_json)


@robots_app.command("remove")
def remove(context: typer.Context, name: NameArgument, as_json: JsonOption = False) -> None:
    """Remove a robot, with the token and certificates that robotctl stores for it."""
    known = drop_robot(name)
    forget_credentials(known.path, name)
    _show(context, known, as_json)
    if known.robots and known.default is None:
        print("No robot is the default now. Type: robotctl robots default NAME", file=sys.stderr)


@robots_app.command("default")
def default(context: typer.Context, name: NameArgument, as_json: JsonOption = False) -> None:
    """Choose the robot that commands use when none is named."""
    _show(context, set_default(name), as_json)


def robots_json(known: RobotsFile) -> dict[str, Any]:
    """Returns the JSON form."""
    return {
        "file": str(known.path),
        "default": known.default,
        "robots": [
            {"name": name, "target": robot.target, "default": name == known.default}
            | {key: str(file) if (file := getattr(robot, key)) else None for key in FILE_KEYS}
            for name, robot in known.robots.items()
        ],
    }


def _show(context: typer.Context, known: RobotsFile, as_json: bool) -> None:
    out = standard_output()
    if json_requested(context, as_json):
        print_json(out, robots_json(known))
    elif known.robots:
        out.print(_table(known))
    else:
        out.print(f"No robot has a name yet ({known.path}).\nType: robotctl robots add NAME HOST:PORT")


def _table(known: RobotsFile) -> Table:
    table = grid("nowrap", "nowrap", "nowrap", "fold")
    for name, robot in known.robots.items():
        is_default = name == known.default
        table.add_row(
            Text(name, style="bold" if is_default else ""),
            Text(robot.target),
            Text("default" if is_default else "", style="green"),
            Text(_access(robot), style="dim"),
        )
    return table


def _access(robot: Robot) -> str:
    parts = {
        "encrypted": robot.ca_certificate_file,
        "client certificate": robot.client_certificate_file,
        "token": robot.token_file,
    }
    return ", ".join(word for word, file in parts.items() if file)
