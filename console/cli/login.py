"""robotctl login: stores a login for a robot, after the robot has accepted it."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from common.errors import ExitCode, UserError
from console.cli.options import JsonOption, json_requested
from console.cli.session import print_json, standard_output
from console.client import Credentials, GatewayClient, parse_target
from console.robots import read_credentials, read_robots_file
from console.robots.credentials import read_public
from console.robots.login import keep_login, parse_login
from console.robots.robots_file import check_name

_STANDARD_INPUT = "-"


def login(
    context: typer.Context,
    name: Annotated[str, typer.Argument(metavar="ROBOT", help="Name to store it under; --robot selects it.")],
    target: Annotated[str, typer.Argument(metavar="HOST:PORT", help="Address of its gateway.")],
    file: Annotated[
        str, typer.Argument(metavar="FILE", help="File with the login; - is standard input.")
    ] = _STANDARD_INPUT,
    *,
    ca: Annotated[Path | None, typer.Option(help="Replace the robot's CA certificate only (PEM).")] = None,
    offline: Annotated[bool, typer.Option(help="Store it without contacting the robot.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Store a login issued by the robot's administrator, for all later commands.

    On one line: ssh HOST robot-gateway credentials add NAME --role operator | robotctl login ROBOT HOST:PORT
    """
    check_name(name)
    target = parse_target(target)
    user, credentials = _with_new_authority(name, ca) if ca else _read(file)
    gateway_name = ""
    if not offline:
        with GatewayClient(target, credentials=credentials) as gateway:
            gateway_name = gateway.status().gateway_name
    known = keep_login(name, target, credentials)
    out = standard_output()
    if json_requested(context, as_json):
        print_json(out, {"robot": name, "target": target, "who": user, "gateway_name": gateway_name})
        return
    result = f"{gateway_name} accepts you" if gateway_name else "not asked"
    as_user = f" as {user}" if user else ""
    out.print(f"{name} at {target}: {result}{as_user}. Stored in {known.path.parent}.")
    out.print(f"Type: robotctl --robot {name} status")


def _read(file: str) -> tuple[str, Credentials]:
    try:
        text = sys.stdin.read() if file == _STANDARD_INPUT else Path(file).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not text"
        raise UserError(f"{file} can't be read: {reason}", exit_code=ExitCode.USAGE) from error
    login = parse_login(text)
    return ", ".join(word for word in (login.name, login.role) if word), login.credentials


def _with_new_authority(name: str, ca: Path) -> tuple[str, Credentials]:
    known = read_credentials(read_robots_file().find(name))
    return "", replace(known, ca_certificate=read_public(ca, "CA certificate file"))
