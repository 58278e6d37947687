"""`robot-gateway`: serve, or only check the configuration."""

from pathlib import Path
from typing import Annotated

import typer

from common import logs
from common.program import run, run_to_exit
from gateway.app import serve as serve_until
from gateway.config import load_settings

app = typer.Typer(help="The robot's side of the door: ROS 2 in, gRPC out.", no_args_is_help=True)

Config = Annotated[
    Path | None,
    typer.Option(help="YAML file; without it the defaults and the GATEWAY__* environment variables count."),
]


@app.command()
def serve(config: Config = None) -> None:
    """Serve operators until SIGINT or SIGTERM."""
    settings = load_settings(config)
    logs.configure(settings.log_level)
    run(lambda stop: serve_until(settings, stop))


@app.command()
def check(config: Config = None) -> None:
    """Say whether the configuration is good, and end."""
    settings = load_settings(config)
    count = len(settings.sources)
    where = f"{settings.grpc.host}:{settings.grpc.port}"
    typer.echo(f"configuration good: '{settings.name}' serves at {where} and reads {count} sources")


def main() -> None:
    """The program."""
    run_to_exit(app)
