"""`robot-gateway`: serve, check the configuration, or find out what is wrong with this machine."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from common import logs
from common.findings import exit_code, print_findings
from common.program import bound_arenas, run, run_to_exit
from gateway.access.reloader import load_access
from gateway.app import serve as serve_until
from gateway.config import CONFIG_VARIABLE, load_settings
from gateway.credentials_cli import app as credentials_app
from gateway.doctor.examination import examine

app = typer.Typer(help="The robot's side of the door: ROS 2 in, gRPC out.", no_args_is_help=True)
app.add_typer(credentials_app, name="credentials")

Config = Annotated[
    Path | None,
    typer.Option(
        envvar=CONFIG_VARIABLE,
        help="YAML file; without it the defaults and the GATEWAY__* environment variables count.",
    ),
]


@app.command()
def serve(config: Config = None) -> None:
    """Serve operators until SIGINT or SIGTERM."""
    settings = load_settings(config)
    logs.configure(settings.log_level, settings.log_format)
    bound_arenas()
    run(lambda stop: serve_until(settings, stop))


@app.command()
def check(config: Config = None) -> None:
    """Say whether the configuration is good, and what it names to ask callers who they are, and end."""
    settings = load_settings(config)
    if access_files := settings.security.access_files():
        load_access(*access_files)
    count = len(settings.sources)
    where = f"{settings.grpc.host}:{settings.grpc.port}"
    typer.echo(f"configuration good: '{settings.name}' serves at {where} and reads {count} sources")


@app.command()
def doctor(
    config: Config = None,
    as_json: Annotated[bool, typer.Option("--json", help="For programs (docs/robotctl.md).")] = False,
) -> None:
    """Find out what keeps this machine from being a robot's gateway, and what to type.

    Ends 0 when nothing is wrong, 1 when something is.
    """
    findings = list(examine(config))
    print_findings(findings, as_json=as_json, out=Console(highlight=False, markup=False, emoji=False))
    raise typer.Exit(int(exit_code(findings)))


def main() -> None:
    """The program."""
    run_to_exit(app)
