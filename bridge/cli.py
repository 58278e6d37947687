"""`robot-bridge`: the command line of the bridge, and of the hub's administration."""

from datetime import UTC, datetime
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from typer.main import get_command

from bridge.config import BridgeSettings
from bridge.uploads import hours
from common import config, logs, program
from common.command_line import read_plainly
from common.errors import ExitCode, UserError
from common.findings import end_with_findings
from common.program_options import JsonOption, PrintOption, SchemaOption, check_settings, config_option

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    help="Connects the robot with its fleet, and sets up the fleet's hub.",
)

_Config = Annotated[Path | None, config_option("bridge")]
_PASSED_ON: Final[dict[str, Any]] = {
    "allow_extra_args": True,
    "ignore_unknown_options": True,
    "help_option_names": [],
}


@app.command()
def serve(config_file: _Config = None) -> None:
    """Takes the robot's state, events and recordings to the fleet's hub, until Ctrl-C."""
    settings = config.load(BridgeSettings, config_file)
    logs.configure(settings.log_level, settings.log_format)
    # Late: the other commands need no NATS.
    from bridge.app import serve as serve_app  # noqa: PLC0415

    program.bound_arenas()
    program.run(partial(serve_app, settings))


@app.command()
def check(config_file: _Config = None, in_effect: PrintOption = False, schema: SchemaOption = False) -> None:
    """Checks the configuration and the files that it names, and exits."""
    if not schema:
        # Late: the other commands need none of this.
        from bridge.files import check_files  # noqa: PLC0415

        settings = config.load(BridgeSettings, config_file)
        check_files(settings)
        for line in hours.sentences(settings.uploads, datetime.now(UTC)):
            typer.echo(line, err=True)
    check_settings(BridgeSettings, config_file, in_effect=in_effect, schema=schema)


@app.command()
def doctor(config_file: _Config = None, as_json: JsonOption = False) -> None:
    """Finds out what keeps this robot from its fleet; exits 1 if something is wrong."""
    from bridge.doctor.examination import examine  # noqa: PLC0415

    end_with_findings(examine(config_file), as_json=as_json)


@app.command(context_settings=_PASSED_ON)
def hub(context: typer.Context) -> None:
    """Sets up the fleet's hub: init, enroll, revoke, robots, receiver, exporter."""
    _administer(context.args)


@app.command(context_settings=_PASSED_ON)
def enroll(context: typer.Context) -> None:
    """Enrolls a robot; short for "hub enroll"."""
    _administer(["enroll", *context.args])


def main() -> None:
    """Entry point."""
    program.run_command_line(app, "robot-bridge")


def _administer(arguments: list[str]) -> None:
    """Runs a command of the hub's administration, which is imported by its name: a robot does not have it."""
    try:
        administration = import_module("hub.cli")
    except ModuleNotFoundError as error:
        raise UserError(
            f"the hub's administration is not installed: {error.name} is missing",
            "On the hub's computer type: pip install 'robot-gateway[hub]'",
        ) from error
    command = get_command(administration.app)
    read_plainly(command)
    code = command.main(arguments, prog_name="robot-bridge hub", standalone_mode=False)
    raise typer.Exit(code if isinstance(code, int) else int(ExitCode.DONE))


if __name__ == "__main__":
    main()
