"""robotctl robots: the robots that this person knows by name."""

from dataclasses import replace
from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from common.errors import UserError
from console.cli.options import JsonOption, json_wanted, robot_names
from console.cli.session import print_json, standard_output
from console.client import parse_target
from console.robots import Robot, RobotsFile, read_robots_file
from console.robots.credentials import forget_credentials
from console.robots.robots_file import FILE_KEYS
from console.robots.robots_file_edit import drop_robot, put_robot, set_default

robots_app = typer.Typer(
    help="The robots known by name; without a further word, lists them.", pretty_exceptions_enable=False
)

NameArgument = Annotated[
    str, typer.Argument(metavar="NAME", help="What the robot is called.", autocompletion=robot_names)
]


@robots_app.callback(invoke_without_command=True)
def robots(context: typer.Context, as_json: JsonOption = False) -> None:
    """The robots known by name; without a further word, lists them."""
    if context.invoked_subcommand is None:
        _show(context, read_robots_file(), as_json)
    elif as_json:
        context.obj = replace(context.obj, as_json=True)


@robots_app.command("add")
def add(
    context: typer.Context,
    name: Annotated[str, typer.Argument(metavar="NAME", help="What it will be called: --robot NAME.")],
    target: Annotated[str, typer.Argument(metavar="HOST:PORT", help="Its gateway.")],
    new_address: Annotated[
        bool, typer.Option("--replace", help="Give a known robot this new address; the rest stays.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Give a robot a name. The first one becomes the default."""
    known = read_robots_file().robots.get(name)
    wanted = replace(known, target=target) if known else Robot(target=target)
    if known and not new_address and known.target != parse_target(target):
        raise UserError(
            f"'{name}' is known already, at {known.target}",
            f"Type: robotctl robots add {name} {target} --replace",
        )
    _show(context, put_robot(name, wanted), as_json)


@robots_app.command("remove")
def remove(context: typer.Context, name: NameArgument, as_json: JsonOption = False) -> None:
    """Forget a robot, with the token and certificates that robotctl keeps for it."""
    book = drop_robot(name)
    forget_credentials(book.path, name)
    _show(context, book, as_json)


@robots_app.command("default")
def default(context: typer.Context, name: NameArgument, as_json: JsonOption = False) -> None:
    """Choose the robot that is meant when none is named."""
    _show(context, set_default(name), as_json)


def robots_json(book: RobotsFile) -> dict[str, Any]:
    """As scripts read it."""
    return {
        "file": str(book.path),
        "default": book.default,
        "robots": [
            {"name": name, "target": robot.target, "default": name == book.default} | _files(robot)
            for name, robot in book.robots.items()
        ],
    }


def _files(robot: Robot) -> dict[str, str | None]:
    paths = {key: getattr(robot, key) for key in FILE_KEYS}
    return {key: str(path) if path else None for key, path in paths.items()}


def _show(context: typer.Context, book: RobotsFile, as_json: bool) -> None:
    out = standard_output()
    if json_wanted(context, as_json):
        print_json(out, robots_json(book))
    elif book.robots:
        out.print(_table(book))
    else:
        out.print(f"No robot has a name yet ({book.path}).\nType: robotctl robots add NAME HOST:PORT")


def _table(book: RobotsFile) -> Table:
    table = Table.grid(padding=(0, 2))
    for _ in range(3):
        table.add_column(no_wrap=True)
    for name, robot in book.robots.items():
        is_default = name == book.default
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
