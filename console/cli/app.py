"""The command line of robotctl. Commands raise their errors; console.cli.run reports them."""

from typing import Annotated

import typer

from common.version import project_version
from console.cli.doctor import doctor
from console.cli.events import events
from console.cli.info import info_json, info_view
from console.cli.json_form import json_form
from console.cli.login import login
from console.cli.options import JsonOption, RobotOption, TargetOption, keep_global_options, session_of
from console.cli.preview import preview_app
from console.cli.robots import robots_app
from console.cli.tables import overlay_view, status_view
from console.cli.watch import watch_until_stopped
from console.cli.windows import monitor, view

app = typer.Typer(
    name="robotctl",
    help="A robot's status and preview, for people and scripts.",
    epilog="Ends 0 when done, 1 when refused or failed, 2 for a wrong command line, 3 when no robot answers.",
    pretty_exceptions_enable=False,
)
app.add_typer(preview_app, name="preview")
app.add_typer(robots_app, name="robots")
for command in (doctor, events, login, monitor, view):
    app.command()(command)


def _print_version(requested: bool) -> None:
    if requested:
        typer.echo(f"robotctl {project_version()}")
        raise typer.Exit


@app.callback()
def robotctl(
    context: typer.Context,
    target: TargetOption = None,
    robot: RobotOption = None,
    as_json: JsonOption = False,
    version: Annotated[  # noqa: ARG001  # its callback prints it
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version.")
    ] = False,
) -> None:
    """A robot's status and preview, for people and scripts."""
    keep_global_options(context, target, robot, as_json)


@app.command()
def status(
    context: typer.Context,
    target: TargetOption = None,
    robot: RobotOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show the status of the whole robot, once."""
    session = session_of(context, target, as_json, robot)
    with session.connect() as gateway:
        answer = gateway.status()
    session.show(json_form(answer), status_view(answer, gateway.target))


@app.command()
def overlay(
    context: typer.Context,
    target: TargetOption = None,
    robot: RobotOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show the robot's detections and the newest events, once."""
    session = session_of(context, target, as_json, robot)
    with session.connect() as gateway:
        snapshot = gateway.overlay()
    session.show(json_form(snapshot), overlay_view(snapshot, gateway.target))


@app.command()
def info(
    context: typer.Context,
    target: TargetOption = None,
    robot: RobotOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show the gateway program: its build, its calls, its configuration."""
    session = session_of(context, target, as_json, robot)
    with session.connect() as gateway:
        answer = gateway.info()
    session.show(info_json(answer), info_view(answer, gateway.target))


@app.command()
def watch(
    context: typer.Context,
    *,
    interval_s: Annotated[
        float,
        typer.Option(
            "--interval", min=0.1, max=3600, metavar="SECONDS", help="Shortest time between updates."
        ),
    ] = 1.0,
    count: Annotated[
        int | None,
        typer.Option("--count", min=1, help="End after so many updates.", show_default="until Ctrl-C"),
    ] = None,
    target: TargetOption = None,
    robot: RobotOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show the status whenever it changes, until Ctrl-C.

    On a terminal it is redrawn in place; a pipe or a file gets one line per update.
    """
    watch_until_stopped(session_of(context, target, as_json, robot), interval_s, count)
