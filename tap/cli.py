"""`robot-tap`: the command line of the camera tap."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from common import config, logs, program
from common.findings import end_with_findings
from common.program_options import JsonOption, PrintOption, SchemaOption, check_settings, config_option
from tap.config import TapSettings

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    help="Hands the frames of ROS image topics to the preview.",
)

_Config = Annotated[Path | None, config_option("tap")]

# ROS 2 is imported late: without it, checking the configuration still works.


@app.command()
def serve(config_file: _Config = None) -> None:
    """Serves the preview until Ctrl-C."""
    settings = config.load(TapSettings, config_file)
    logs.configure(settings.log_level, settings.log_format)
    from tap.app import serve as serve_app  # noqa: PLC0415

    program.bound_arenas()
    program.run(partial(serve_app, settings))


@app.command()
def check(config_file: _Config = None, in_effect: PrintOption = False, schema: SchemaOption = False) -> None:
    """Checks the configuration and exits."""
    check_settings(TapSettings, config_file, in_effect=in_effect, schema=schema)


@app.command()
def doctor(
    config_file: _Config = None,
    as_json: JsonOption = False,
) -> None:
    """Finds out which image topics there are and what is wrong with them; exits 1 if something is."""
    from tap.doctor import examine  # noqa: PLC0415

    end_with_findings(examine(config_file), as_json=as_json)


def main() -> None:
    """Entry point."""
    program.run_command_line(app, "robot-tap")


if __name__ == "__main__":
    main()
