"""`robot-preview`: the command line of the preview service."""

import asyncio
import json
import os
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from common import config, logs, program
from common.program_options import JsonOption, PrintOption, SchemaOption, check_settings, config_option
from preview.config import PreviewSettings

app = typer.Typer(no_args_is_help=True, add_completion=False, help="Serves the robot's live video.")

_Config = Annotated[Path | None, config_option("preview")]

# GStreamer is imported late: without it, checking the configuration still works.


@app.command()
def serve(config_file: _Config = None) -> None:
    """Serves the gateway until Ctrl-C."""
    settings = _load(config_file)
    # Trials are started by fork and exec; gRPC's handlers for a bare fork would only get in their way.
    os.environ.setdefault("GRPC_ENABLE_FORK_SUPPORT", "0")
    from preview.app import serve as serve_app  # noqa: PLC0415

    program.run(partial(serve_app, settings))


@app.command()
def check(config_file: _Config = None, in_effect: PrintOption = False, schema: SchemaOption = False) -> None:
    """Checks the configuration and exits."""
    check_settings(PreviewSettings, config_file, in_effect=in_effect, schema=schema)


@app.command()
def encoders(
    config_file: _Config = None,
    as_json: JsonOption = False,
) -> None:
    """Tries every encoder and lists the results."""
    settings = _load(config_file)
    from preview.encoders import listing, probe, trial  # noqa: PLC0415

    order, deadline_s = settings.encoders, settings.encoders.probe_timeout_s
    attempt = partial(trial.attempt, settings.profiles.largest, deadline_s)
    prober = probe.TrialProber(attempt, repeats=False)
    rows = asyncio.run(listing.rows(prober, order.preference, order.allowed))
    print(json.dumps(rows, indent=2) if as_json else listing.table(rows))


def main() -> None:
    """Entry point."""
    program.run_command_line(app, "robot-preview")


def _load(config_file: Path | None) -> PreviewSettings:
    settings = config.load(PreviewSettings, config_file)
    logs.configure(settings.log_level, settings.log_format)
    return settings


if __name__ == "__main__":
    main()
