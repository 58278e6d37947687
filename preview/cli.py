"""`robot-preview`: the program that makes the video."""

import asyncio
import json
import os
from pathlib import Path
from typing import Annotated

import typer

from common import config, logs, program
from preview.config import PreviewSettings

app = typer.Typer(no_args_is_help=True, add_completion=False, help="Makes the robot's live video.")

_Config = Annotated[
    Path | None, typer.Option("--config", help="YAML file; without it the defaults and PREVIEW__... count.")
]


@app.command()
def serve(config_file: _Config = None) -> None:
    """Serves the gateway until Ctrl-C."""
    program.run_to_exit(lambda: _serve(config_file))


@app.command()
def check(config_file: _Config = None) -> None:
    """Checks the configuration and ends."""
    program.run_to_exit(lambda: _check(config_file))


@app.command()
def encoders(
    config_file: _Config = None,
    as_json: Annotated[bool, typer.Option("--json", help="For programs.")] = False,
) -> None:
    """Tries every encoder and lists what came of it."""
    program.run_to_exit(lambda: _encoders(config_file, as_json=as_json))


def main() -> None:
    """The entry point."""
    app()


def _serve(config_file: Path | None) -> None:
    settings = config.load(PreviewSettings, config_file)
    logs.configure(settings.log_level, settings.log_format)
    # Trials are started by fork and exec; gRPC's own handlers for a bare fork only get in their way.
    os.environ.setdefault("GRPC_ENABLE_FORK_SUPPORT", "0")
    # Imported late: without GStreamer a check of the configuration still works.
    from preview.app import serve as serve_app  # noqa: PLC0415

    program.run(lambda stop: serve_app(settings, stop))


def _check(config_file: Path | None) -> None:
    config.load(PreviewSettings, config_file)
    print(f"{config_file or 'the environment'}: ok")


def _encoders(config_file: Path | None, *, as_json: bool) -> None:
    settings = config.load(PreviewSettings, config_file)
    logs.configure(settings.log_level, settings.log_format)
    from preview.encoders import listing  # noqa: PLC0415  # as above

    rows = asyncio.run(listing.try_all(settings))
    print(json.dumps(rows, indent=2) if as_json else listing.table(rows))


if __name__ == "__main__":
    main()
