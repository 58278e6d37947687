"""`robot-drive`: the command line of the drive program."""

import signal
from pathlib import Path
from typing import Annotated

import typer

from common import config, logs, program
from common.findings import end_with_findings
from common.program_options import JsonOption, PrintOption, SchemaOption, check_settings, config_option
from drive.config import DriveSettings
from drive.log_thread import log_in_thread

app = typer.Typer(no_args_is_help=True, add_completion=False, help="Moves the robot for an operator.")

_Config = Annotated[Path | None, config_option("drive")]

# ROS 2 is imported late: without it, checking the configuration still works.


@app.command()
def serve(config_file: _Config = None) -> None:
    """Serves the gateway until Ctrl-C."""
    settings = _load(config_file)
    from drive.app import serve as serve_app  # noqa: PLC0415

    raise typer.Exit(serve_app(settings, config_file))


@app.command(hidden=True)
def worker(config_file: _Config = None) -> None:
    """Runs the process that `serve` watches."""
    settings = _load(config_file)
    from drive.app import work  # noqa: PLC0415

    work(settings)


@app.command(hidden=True)
def pulse(config_file: _Config = None) -> None:
    """Runs the process that moves the robot for `doctor --pulse`, which watches it."""
    settings = _load(config_file)
    from drive.doctor.pulse import run_pulse  # noqa: PLC0415
    from drive.processes.guard import worker_heartbeats  # noqa: PLC0415

    with worker_heartbeats() as heartbeats:
        run_pulse(settings, heartbeats)


@app.command()
def check(config_file: _Config = None, in_effect: PrintOption = False, schema: SchemaOption = False) -> None:
    """Checks the configuration and exits."""
    check_settings(DriveSettings, config_file, in_effect=in_effect, schema=schema)


@app.command()
def doctor(
    config_file: _Config = None,
    pulse: Annotated[
        bool,
        typer.Option(
            "--pulse", help="Move the robot forward, by up to 20 cm, to see whether and how it stops."
        ),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Finds out what keeps this robot from being driven, and what stops it; exits 1 if something is wrong."""
    from drive.doctor.examination import examine  # noqa: PLC0415

    # So that a terminal that is closed, and Ctrl-\, end a pulse with zeros.
    for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.default_int_handler)
    end_with_findings(examine(config_file, with_pulse=pulse), as_json=as_json)


def main() -> None:
    """Entry point."""
    program.run_command_line(app, "robot-drive")


def _load(config_file: Path | None) -> DriveSettings:
    settings = config.load(DriveSettings, config_file)
    logs.configure(settings.log_level, settings.log_format)
    log_in_thread()
    return settings


if __name__ == "__main__":
    main()
