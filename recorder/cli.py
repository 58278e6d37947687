"""`robot-recorder`: the command line of the recorder."""

import json
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from common import config, logs, program
from common.errors import ExitCode
from common.findings import end_with_findings
from common.program_options import JsonOption, PrintOption, SchemaOption, check_settings, config_option
from recorder.config import RecorderSettings
from recorder.priority import step_back

app = typer.Typer(no_args_is_help=True, add_completion=False, help="Records the robot's topics and video.")

_Config = Annotated[Path | None, config_option("recorder")]

# ROS 2 is imported late: without it, checking the configuration and recovering a disk still work.


@app.command()
def serve(config_file: _Config = None) -> None:
    """Records until Ctrl-C."""
    settings = _load(config_file)
    # Before there are other threads, which the import of rclpy starts as well: each begins with the priority
    # of the one that starts it.
    step_back()
    from recorder.app import serve as serve_app  # noqa: PLC0415

    program.bound_arenas()
    program.run(partial(serve_app, settings))


@app.command()
def check(config_file: _Config = None, in_effect: PrintOption = False, schema: SchemaOption = False) -> None:
    """Checks the configuration and exits."""
    check_settings(RecorderSettings, config_file, in_effect=in_effect, schema=schema)


@app.command()
def recover(
    directory: Annotated[Path, typer.Argument(help="A folder of recordings, one recording, or one file.")],
    as_json: JsonOption = False,
) -> None:
    """Makes recordings of a disk whole that were cut off. Needs no configuration and no running recorder."""
    logs.configure("warning")
    from recorder.recover_disk import recover_below, sentence  # noqa: PLC0415

    found = recover_below(directory)
    if as_json:
        print(json.dumps([each.as_dict() for each in found], indent=2, ensure_ascii=False))
    else:
        for each in found:
            print(sentence(each))
        if not found:
            print(f"{directory}: nothing was cut off")
    failed = any(each.error for each in found)
    raise typer.Exit(int(ExitCode.FAILED if failed else ExitCode.DONE))


@app.command()
def doctor(config_file: _Config = None, as_json: JsonOption = False) -> None:
    """Finds out what keeps this robot from recording; exits 1 if something is wrong."""
    from recorder.doctor.examination import examine  # noqa: PLC0415

    end_with_findings(examine(config_file), as_json=as_json)


def main() -> None:
    """Entry point."""
    program.run_command_line(app, "robot-recorder")


def _load(config_file: Path | None) -> RecorderSettings:
    settings = config.load(RecorderSettings, config_file)
    logs.configure(settings.log_level, settings.log_format)
    return settings


if __name__ == "__main__":
    main()
