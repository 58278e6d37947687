"""robotctl robots: lists, adds and removes robots known by name."""

import os
import shlex
import sys
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from common.errors import UserError
from console.cli.fleet_status import answers_json, answers_table, ask_all, exit_code
from console.cli.options import JsonOption, json_requested, robot_names
from console.cli.session import print_json, standard_output
from console.cli.tables import grid
from console.robots import Robot, RobotsFile, read_robots_file
from console.robots.credentials import forget_credentials
from console.robots.robots_file import FILE_KEYS
from console.robots.robots_file_edit import drop_robot, put_robot, set_default
from console.target import parse_target

if TYPE_CHECKING:
    from console.robots.discovery import DiscoveredRobot

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
            f"Type: {shlex.join(['robotctl', *sys.argv[1:], '--replace'])}",
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


@robots_app.command("status")
def status(
    context: typer.Context,
    within_s: Annotated[
        float,
        typer.Option("--within", min=0.2, max=60, metavar="SECONDS", help="How long a robot may take."),
    ] = 3.0,
    as_json: JsonOption = False,
) -> None:
    """Show the status of all known robots in one table, asked side by side.

    Exit code 0 when all have answered, 3 when one did not, 1 when one refused.
    """
    known = read_robots_file()
    if not known.robots:
        _show(context, known, as_json)
        return
    answers = ask_all(known, within_s)
    out = standard_output()
    if json_requested(context, as_json):
        print_json(out, answers_json(answers))
    else:
        out.print(answers_table(answers))
    raise typer.Exit(int(exit_code(answers)))


@robots_app.command("discover")
def discover(
    context: typer.Context,
    wait_s: Annotated[
        float, typer.Option("--wait", min=0.2, max=60, metavar="SECONDS", help="How long to search.")
    ] = 3.0,
    as_json: JsonOption = False,
) -> None:
    """List the robots that announce themselves on this network (mDNS). Nothing found is trusted."""
    # Late: its library takes long to import.
    from console.robots import discovery  # noqa: PLC0415

    known = read_robots_file()
    found, truncated = discovery.discover(wait_s, discovery.addresses_in(os.environ))
    names = {robot.target: name for name, robot in known.robots.items()}
    out = standard_output()
    if json_requested(context, as_json):
        robots = [{**asdict(each), "known_as": names.get(each.target)} for each in found]
        print_json(out, {"robots": robots, "truncated": truncated})
        return
    if not found:
        out.print("No robot announces itself on this network.\nRobots do with discovery.advertise: true.")
        return
    table = grid("nowrap", "nowrap", "nowrap", "fold")
    for each in found:
        access = "TLS, needs a login" if each.tls else "not encrypted"
        table.add_row(
            Text(each.name), Text(each.target), Text(access, style="dim"), Text(_next_step(each, names))
        )
    out.print(table)
    if truncated:
        out.print("There are more announcements than are shown: this network may be flooded.")
    out.print("Anyone on this network can announce anything: a login checks the robot's certificate.")


def _next_step(found: "DiscoveredRobot", names: Mapping[str, str]) -> str:
    if name := names.get(found.target):
        return f"known as {name}"
    if found.tls:
        return found.login_command
    return f"robotctl robots add {found.nickname} {found.target}"


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
