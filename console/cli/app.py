"""The commands of robotctl. Each asks, prints, and lets errors go up to `console.cli.run`."""

from typing import Annotated

import typer

from common.version import project_version
from console.cli.doctor import doctor
from console.cli.events import events
from console.cli.info import info_json, info_view
from console.cli.json_form import json_form
from console.cli.login import login
from console.cli.monitor import monitor
from console.cli.options import JsonOption, RobotOption, TargetOption, remember, session_of
from console.cli.preview import preview_app
from console.cli.robots import robots_app
from console.cli.tables import overlay_view, status_view
from console.cli.view import view
from console.cli.watch import watch_until_stopped

app = typer.Typer(
    name="robotctl",
    help="A robot's status and preview, for people and scripts.",
    epilog="Ends 0 when done, 1 when refused or failed, 2 for a wrong command line, 3 when no robot answers.",
    pretty_exceptions_enable=False,
)
app.add_typer(preview_app, name="preview")
app.add_typer(robots_app, name="robots")
app.command()(doctor)
app.command()(events)
app.command()(login)
app.command()(monitor)
app.command()(view)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"robotctl {project_version()}")
        raise typer.Exit


@app.callback()
def robotctl(
    context: typer.Context,
    target: TargetOption = None,
    robot: RobotOption = None,
    as_json: JsonOption = False,
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version.")
    ] = False,
) -> None:
    """A robot's status and preview, for people and scripts."""
    remember(context, target, robot, as_json)


@app.command()
def status(
    context: typer.Context,
    target: TargetOption = None,
    robot: RobotOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show everything the gateway knows about the robot, once."""
    session = session_of(context, target, as_json, robot)
    with session.connect() as gateway:
        answer = gateway.status()
    if session.as_json:
        session.print_json(json_form(answer))
    else:
        session.out.print(status_view(answer, gateway.target))


@app.command()
def overlay(
    context: typer.Context,
    target: TargetOption = None,
    robot: RobotOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show what the robot sees and the newest events, once."""
    session = session_of(context, target, as_json, robot)
    with session.connect() as gateway:
        snapshot = gateway.overlay()
    if session.as_json:
        session.print_json(json_form(snapshot))
    else:
        session.out.print(overlay_view(snapshot, gateway.target))


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
    if session.as_json:
        session.print_json(info_json(answer))
    else:
        session.out.print(info_view(answer, gateway.target))


@app.command()
def watch(
    context: typer.Context,
    *,
    interval_s: Annotated[
        float,
        typer.Option("--interval", min=0.1, max=3600, metavar="SECONDS", help="Time between two looks."),
    ] = 1.0,
    count: Annotated[
        int | None,
        typer.Option("--count", min=1, help="End after so many looks.", show_default="until Ctrl-C"),
    ] = None,
    target: TargetOption = None,
    robot: RobotOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show the status again and again, until Ctrl-C.

    On a terminal it is redrawn in place; into a pipe goes one line per look.
    """
    watch_until_stopped(session_of(context, target, as_json, robot), interval_s, count)
