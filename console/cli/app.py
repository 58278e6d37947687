"""The command line of robotctl. Commands raise their errors; console.cli.run reports them."""

from collections.abc import Mapping
from typing import Annotated, Final

import typer
from typer.core import TyperGroup

from common.command_line import read_plainly
from console.cli.lazy import LazyCommand, imported
from console.cli.options import GlobalOptions, JsonOption, RobotOption, TargetOption

COMMANDS: Final[Mapping[str, tuple[str, str]]] = {
    "status": ("console.cli.status:status", "Show the status of the whole robot, once."),
    "watch": ("console.cli.watch:watch", "Show the status whenever it changes, until Ctrl-C."),
    "overlay": (
        "console.cli.status:overlay",
        "Show the robot's detections and the newest events, once.",
    ),
    "events": (
        "console.cli.events:events",
        "Show past events of the robot, as far back as the gateway keeps them.",
    ),
    "info": ("console.cli.info:info", "Show the gateway program: build, call counts, configuration."),
    "doctor": (
        "console.cli.doctor:doctor",
        "Check name, network, login, gateway, clock and robot, and say what to do about each fault.",
    ),
    "login": (
        "console.cli.login:login",
        "Store a login issued by the robot's administrator, for all later commands.",
    ),
    "view": (
        "console.cli.windows:view",
        "Show the live preview with detections overlaid. The robot provides all settings.",
    ),
    "monitor": (
        "console.cli.windows:monitor",
        "Open a window: live video, status, faults, driving, recordings, preview controls.",
    ),
    "preview": ("console.cli.preview:preview_app", "Turn the live preview on or off."),
    "stop": (
        "console.cli.stop:stop",
        "Stop the robot until reset-stop, no matter who drives it. Needs the role of a viewer.",
    ),
    "reset-stop": (
        "console.cli.stop:reset_stop",
        "Reset a stop of the robot. Nothing moves by it; a newer stop stays.",
    ),
    "drive": (
        "console.cli.drive:drive",
        "Drive the robot by keyboard or gamepad, with your own eyes on it, where the robot permits that.",
    ),
    "practice": (
        "practice.cli:practice",
        "Practise driving in the monitor's window, without a robot: nothing leaves this computer.",
    ),
    "record": (
        "console.cli.record:record_app",
        "Record on the robot, keep its last minutes, copy recordings to this computer.",
    ),
    "fleet": (
        "console.cli.fleet:fleet_app",
        "Show all robots of a fleet, by its hub, without asking any of them.",
    ),
    "robots": ("console.cli.robots:robots_app", "List the robots known by name, or change the list."),
}
"""Each command's function (or group of commands), and the first line of its own help."""

# Plain help: Rich, which would draw boxes around it, takes twice as long to import as everything else here.
_app = typer.Typer(
    name="robotctl",
    help="Show a robot's status and video, drive it, and record on it; show a fleet of them.",
    epilog="Exit codes: 0 done, 1 refused or failed, 2 wrong command line, 3 no robot answers.",
    rich_markup_mode=None,
)


def _print_version(requested: bool) -> None:
    if requested:
        version = imported("common.version:project_version")()
        typer.echo(f"robotctl {version}")
        raise typer.Exit


@_app.callback()
def _robotctl(
    context: typer.Context,
    target: TargetOption = None,
    robot: RobotOption = None,
    as_json: JsonOption = False,
    version: Annotated[  # noqa: ARG001  # its callback prints it
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version.")
    ] = False,
) -> None:
    """Show a robot's status and video, drive it, and record on it; show a fleet of them."""
    context.obj = GlobalOptions(target, robot, as_json)


def command_line() -> TyperGroup:
    """Returns robotctl with all its commands, none of which is imported yet."""
    group = typer.main.get_command(_app)
    assert isinstance(group, TyperGroup), "it has a callback"  # noqa: S101  # Typer's rule
    read_plainly(group)
    for name, (place, summary) in COMMANDS.items():
        group.add_command(LazyCommand(name, place, summary))
    return group
