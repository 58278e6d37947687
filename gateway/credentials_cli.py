"""`robot-gateway credentials`: manages who may call this robot. A running gateway applies changes at once."""

import json
import sys
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Final, TypeAlias

import typer

from common.addresses import is_loopback
from common.errors import ExitCode, UserError
from common.private_files import write_private
from gateway.access.command import credentials_command
from gateway.access.credential import Credential, Kind
from gateway.access.credential_admin import CredentialAdmin, CredentialRequest, Issued
from gateway.access.directory import CredentialDirectory
from gateway.access.role import Role
from gateway.config import CONFIG_VARIABLE, GatewaySettings, load_settings
from gateway.platform.hosts import find_hosts, with_loopback

app = typer.Typer(help="Manage who may call this robot.", no_args_is_help=True)

_MS_PER_S: Final = 1000

Config: TypeAlias = Annotated[
    Path | None, typer.Option(envvar=CONFIG_VARIABLE, help="Configuration with security.credentials.")
]
Directory: TypeAlias = Annotated[
    Path | None, typer.Option(help="Directory of the credentials, instead of security.credentials.")
]
_DAYS_HELP: Final = "Validity; by default unlimited for tokens, a year for certificates."
_HOST_HELP: Final = "A name or address by which laptops reach this robot; may be repeated."
Hosts: TypeAlias = Annotated[list[str] | None, typer.Option("--host", metavar="HOST", help=_HOST_HELP)]
Out: TypeAlias = Annotated[
    Path | None, typer.Option(help="Write the login to this file (0600) instead of printing it.")
]
AsJson: TypeAlias = Annotated[bool, typer.Option("--json", help="For programs (docs/security.md).")]


@app.command()
def init(
    config: Config = None,
    directory: Directory = None,
    host: Hosts = None,
    again: Annotated[
        bool, typer.Option("--again", help="Discard existing credentials.", show_default=False)
    ] = False,
) -> None:
    """Create this robot's certificate authority, the gateway's certificate and an empty list."""
    settings, files = _open(config, directory)
    hosts = with_loopback(host) if host else find_hosts()
    CredentialAdmin(files, settings.name).initialize(hosts, again=again)
    _say(
        f"{files.path}: created a certificate authority, a certificate and an empty list of credentials.",
        f"The certificate is valid for {', '.join(hosts)}.",
        "",
    )
    in_use = settings.security.credentials == files.path and not is_loopback(settings.grpc.host)
    if not in_use:
        _say(
            "In the gateway's configuration:",
            f"  grpc: {{host: 0.0.0.0}}\n  security: {{credentials: {files.path}}}",
        )
    add_one = credentials_command("add NAME --role viewer|operator|admin", directory, config)
    _say(f"Then, for each person:  {add_one}")


@app.command()
def add(
    name: Annotated[str, typer.Argument(help="Of the person or program.")],
    role: Annotated[Role, typer.Option(help="What the credential permits.")],
    *,
    config: Config = None,
    directory: Directory = None,
    certificate: Annotated[
        bool,
        typer.Option("--certificate", help="A client certificate instead of a token.", show_default=False),
    ] = False,
    days: Annotated[
        float | None,
        typer.Option(min=0.0001, max=36500, help=_DAYS_HELP),
    ] = None,
    begins: Annotated[
        datetime | None, typer.Option(help="Not valid before this time (UTC).", metavar="DATE")
    ] = None,
    out: Out = None,
) -> None:
    """Issue a credential. The login for the laptop is printed once and not stored."""
    settings, files = _open(config, directory)
    begins_s = int(begins.replace(tzinfo=UTC).timestamp()) if begins else None
    kind = Kind.CERTIFICATE if certificate else Kind.TOKEN
    request = CredentialRequest(name, role, kind, begins_s, days)
    _output(CredentialAdmin(files, settings.name).add(request), out, settings)


@app.command("list")
def list_all(config: Config = None, directory: Directory = None, as_json: AsJson = False) -> None:
    """List all credentials with name, role, validity and state; nothing of it is secret."""
    _, files = _open(config, directory)
    credentials = tuple(files.read_store().credentials.values())
    now_s = time.time()
    if as_json:
        typer.echo(json.dumps([_as_json(each, now_s) for each in credentials], indent=2))
        return
    # Late: the other commands print no table.
    from rich.console import Console  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415

    table = Table.grid(padding=(0, 2))
    table.add_row("id", "name", "role", "kind", "made", "ends", "state")
    for each in credentials:
        row = (each.credential_id, each.name, each.role.value, each.kind.value)
        table.add_row(*row, _minute(each.made_s), _minute(each.ends_s), each.validity(now_s).value)
    # Without a terminal, rich would fold the table at 80 columns.
    width = None if sys.stdout.isatty() else 160
    Console(highlight=False, markup=False, emoji=False, width=width).print(table)


@app.command()
def revoke(
    name_or_id: Annotated[str, typer.Argument(metavar="NAME|ID")],
    config: Config = None,
    directory: Directory = None,
) -> None:
    """Revoke all credentials of a name, or the one of an id. Open streams end, too."""
    settings, files = _open(config, directory)
    for each in CredentialAdmin(files, settings.name).revoke(name_or_id):
        typer.echo(f"revoked: {each.credential_id}, {each.role.value} {each.name}")


@app.command()
def rotate(
    what: Annotated[
        str, typer.Argument(metavar="NAME|ID|server|ca", help="A credential, or which certificate.")
    ],
    *,
    config: Config = None,
    directory: Directory = None,
    host: Hosts = None,
    overlap_hours: Annotated[
        float, typer.Option(min=0, max=8760, help="How long the old credential remains valid.")
    ] = 0,
    out: Out = None,
) -> None:
    """Replace a credential, the gateway's certificate, or the certificate authority."""
    settings, files = _open(config, directory)
    admin = CredentialAdmin(files, settings.name)
    hosts = with_loopback(host) if host else None
    if what == "server":
        _say(f"new certificate, valid for {', '.join(admin.rotate_server(hosts))}. Laptops need no change.")
    elif what == "ca":
        for each in admin.rotate_ca(hosts):
            _say(f"revoked, as the old certificate authority signed it: {each.credential_id}, {each.name}")
        _say(
            "new certificate authority. Tokens remain valid. "
            f"On each laptop:  robotctl login ROBOT HOST:{settings.grpc.port} --ca FILE, with this:"
        )
        typer.echo(files.ca.read().certificate.decode(), nl=False)
    else:
        _output(admin.rotate(what, round(overlap_hours * 3600)), out, settings)


def _open(config: Path | None, directory: Path | None) -> tuple[GatewaySettings, CredentialDirectory]:
    settings = load_settings(config)
    path = directory or settings.security.credentials
    if path is None:
        raise UserError(
            "the directory of the credentials is unknown",
            "Give it: --directory DIR, or security.credentials in the file that --config names",
            exit_code=ExitCode.USAGE,
        )
    return settings, CredentialDirectory(path)


def _output(issued: Issued, out: Path | None, settings: GatewaySettings) -> None:
    """Writes the login to standard output or a file, and everything else to standard error."""
    credential, bundle = issued
    if out:
        write_private(out, bundle.text().encode())
    else:
        typer.echo(bundle.text(), nl=False)
    _say(
        f"{credential.kind.value} {credential.credential_id} for {credential.name}, {credential.role.value}"
        + (f", until {_minute(credential.ends_s)}" if credential.ends_s else ""),
        f"On the laptop:  robotctl login ROBOT HOST:{settings.grpc.port} {out or 'FILE'}",
        "The login is secret: transfer it over a private channel, then delete the file.",
    )


def _say(*lines: str) -> None:
    """Prints to standard error; standard output is for the login."""
    for line in lines:
        typer.echo(line, err=True)


def _minute(instant_s: int | None) -> str:
    return "-" if instant_s is None else datetime.fromtimestamp(instant_s, UTC).strftime("%Y-%m-%d %H:%M UTC")


def _as_json(credential: Credential, now_s: float) -> dict[str, Any]:
    instants = {
        "made": credential.made_s,
        "begins": credential.begins_s,
        "ends": credential.ends_s,
        "revoked": credential.revoked_s,
    }
    return {
        "id": credential.credential_id,
        "name": credential.name,
        "role": credential.role.value,
        "kind": credential.kind.value,
        "state": credential.validity(now_s).value,
    } | {f"{name}_unix_ms": None if at_s is None else at_s * _MS_PER_S for name, at_s in instants.items()}
