"""`robot-gateway`: serve, check the configuration, or find out what is wrong with this machine."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from common import logs
from common.config import SettingsConflictError, as_yaml, json_schema
from common.errors import UserError
from common.program import bound_arenas, run, run_command_line
from common.program_options import PrintOption, SchemaOption
from gateway.config import CONFIG_VARIABLE, GatewaySettings, load_settings, without_effect
from gateway.credentials_cli import app as credentials_app

app = typer.Typer(help="The robot's side of the door: ROS 2 in, gRPC out.", no_args_is_help=True)
app.add_typer(credentials_app, name="credentials")

# gRPC and the checks are imported late: checking the configuration needs neither.

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
    # The advertiser is started by fork and exec; gRPC's handlers for a bare fork would only get in its way.
    os.environ.setdefault("GRPC_ENABLE_FORK_SUPPORT", "0")
    settings = load_settings(config)
    logs.configure(settings.log_level, settings.log_format)
    from gateway.app import serve as serve_until  # noqa: PLC0415

    bound_arenas()
    run(lambda stop: serve_until(settings, stop))


@app.command()
def check(config: Config = None, in_effect: PrintOption = False, schema: SchemaOption = False) -> None:
    """Check the configuration, and the credentials and certificates that it names, and end.

    What passes is accepted by serve; a message type that is not installed shows only on the robot (doctor),
    and the fields of generic sources are checked only where their message types are installed.
    """
    if schema:
        typer.echo(json_schema(GatewaySettings))
        return
    unchecked: list[str] = []
    settings = load_settings(config, _check_readers, lambda loaded: unchecked.extend(_check_fields(loaded)))
    if access_files := settings.security.access_files():
        from gateway.access.reloader import load_access  # noqa: PLC0415

        load_access(*access_files)
    for line in (*unchecked, *without_effect(settings)):
        typer.echo(line, err=True)
    if in_effect:
        typer.echo(as_yaml(settings), nl=False)
        return
    count = len(settings.sources)
    where = f"{settings.grpc.host}:{settings.grpc.port}"
    typer.echo(f"configuration good: '{settings.name}' serves at {where} and reads {count} sources")


def _check_readers(settings: GatewaySettings) -> None:
    # Late: importing it checks the middleware, which an error at the import could not report in one line.
    from gateway.ros.readers import reader_for  # noqa: PLC0415

    for position, source in enumerate(settings.sources):
        try:
            reader_for(source)
        except UserError as error:
            raise SettingsConflictError(("sources", position, "type"), error.what, error.remedy) from error


def _check_fields(settings: GatewaySettings) -> Iterator[str]:
    """Yields a line for each field that can't be checked on this machine.

    Raises:
        SettingsConflictError: an installed message type lacks the field of a source.
    """
    generic = [(position, source) for position, source in enumerate(settings.sources) if source.is_generic]
    if not generic:
        return
    try:
        # Late: it needs rclpy, which the check of a configuration without generic sources does not.
        from common.ros_node import TypeMissingError, message_class  # noqa: PLC0415
        from gateway.ros.field_types import FieldMissingError, check_field  # noqa: PLC0415
    except UserError as error:
        yield f"not checked: the fields of {len(generic)} generic sources: {error.what}"
        return
    for position, source in generic:
        try:
            check_field(message_class(source.type), source)
        except TypeMissingError as error:
            yield f"not checked: field {source.field} of '{source.name}': {error}"
        except FieldMissingError as error:
            raise SettingsConflictError(
                ("sources", position, "field"),
                f"source '{source.name}' ({source.topic}): {error}",
                f"Correct field or type; to list the fields, type: ros2 interface show {source.type}",
            ) from error


@app.command()
def doctor(
    config: Config = None,
    as_json: Annotated[bool, typer.Option("--json", help="For programs (docs/robotctl.md).")] = False,
) -> None:
    """Find out what keeps this machine from being a robot's gateway, and what to type.

    Ends 0 when nothing is wrong, 1 when something is.
    """
    from common.findings import end_with_findings  # noqa: PLC0415
    from gateway.doctor.examination import examine  # noqa: PLC0415

    end_with_findings(examine(config), as_json=as_json)


def main() -> None:
    """The program."""
    run_command_line(app, "robot-gateway")
