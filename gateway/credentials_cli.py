"""`robot-gateway credentials`: who may call this robot, and with what. Takes effect in a running gateway."""

import json
import sys
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Final, TypeAlias

import typer
from rich.console import Console
from rich.table import Table

from common.errors import ExitCode, UserError
from common.private_files import write_private
from gateway.access.bundle import Bundle
from gateway.access.command import to_type
from gateway.access.credential import Credential, Kind
from gateway.access.directory import CredentialDirectory
from gateway.access.keeping import Keeper, Wanted
from gateway.access.role import Role
from gateway.config import CONFIG_VARIABLE, GatewaySettings, is_loopback, load_settings
from gateway.platform.hosts import hosts_found, with_local

app = typer.Typer(help="Who may call this robot, and with what.", no_args_is_help=True)

_MS_PER_S: Final = 1000

Config: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        envvar=CONFIG_VARIABLE, help="The gateway's configuration: security.credentials says where they are."
    ),
]
Directory: TypeAlias = Annotated[
    Path | None, typer.Option(help="Where they are, in place of security.credentials.")
]
Hosts: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--host",
        help="A name or an address by which laptops call this robot; several are allowed.",
        metavar="HOST",
    ),
]
Out: TypeAlias = Annotated[
    Path | None,
    typer.Option(help="Write the login into this file (0600) instead of printing it."),
]
AsJson: TypeAlias = Annotated[bool, typer.Option("--json", help="For programs (docs/security.md).")]


@app.command()
def init(
    config: Config = None,
    directory: Directory = None,
    host: Hosts = None,
    again: Annotated[bool, typer.Option(help="Throw away what is there.")] = False,
) -> None:
    """Make this robot's certificate authority, the gateway's certificate and an empty list."""
    settings, where = _place(config, directory)
    hosts = with_local(host or ()) if host else hosts_found()
    Keeper(where, settings.name).begin(hosts, again=again)
    _say(
        f"{where.path}: authority, certificate and an empty list are made.",
        f"The certificate is good for {', '.join(hosts)}.",
        "",
    )
    if not _asked_for(settings, where):
        _say(
            "In the gateway's configuration:",
            f"  grpc: {{host: 0.0.0.0}}\n  security: {{credentials: {where.path}}}",
        )
    _say(f"Then, for each person:  {to_type('add NAME --role viewer|operator|admin')}")


@app.command()
def add(
    name: Annotated[str, typer.Argument(help="Of the person or the program.")],
    role: Annotated[Role, typer.Option(help="What they may do.")],
    *,
    config: Config = None,
    directory: Directory = None,
    certificate: Annotated[bool, typer.Option(help="A client certificate in place of a token.")] = False,
    days: Annotated[
        float | None,
        typer.Option(
            min=0.0001, max=36500, help="How long it is valid; a token for ever, a certificate a year."
        ),
    ] = None,
    begins: Annotated[
        datetime | None, typer.Option(help="Not valid before this moment (UTC).", metavar="DATE")
    ] = None,
    out: Out = None,
) -> None:
    """Give somebody a credential. What goes onto the laptop is printed once and kept nowhere."""
    settings, where = _place(config, directory)
    begins_s = int(begins.replace(tzinfo=UTC).timestamp()) if begins else None
    kind = Kind.CERTIFICATE if certificate else Kind.TOKEN
    credential, bundle = Keeper(where, settings.name).add(Wanted(name, role, kind, begins_s, days))
    _hand_over(credential, bundle, out, settings)


@app.command("list")
def list_all(config: Config = None, directory: Directory = None, as_json: AsJson = False) -> None:
    """Show all credentials: whose, what they allow, until when. Nothing of it is secret."""
    _, where = _place(config, directory)
    credentials = tuple(where.read_store().credentials.values())
    now_s = time.time()
    if as_json:
        typer.echo(json.dumps([_as_json(each, now_s) for each in credentials], indent=2))
        return
    table = Table.grid(padding=(0, 2))
    table.add_row("id", "name", "role", "kind", "made", "ends", "state")
    for each in credentials:
        table.add_row(
            each.credential_id,
            each.name,
            each.role.value,
            each.kind.value,
            _day(each.made_s),
            _day(each.ends_s),
            each.state(now_s).value,
        )
    Console(highlight=False, markup=False, emoji=False, width=None if sys.stdout.isatty() else 160).print(
        table
    )


@app.command()
def revoke(
    name_or_id: Annotated[str, typer.Argument(metavar="NAME|ID")],
    config: Config = None,
    directory: Directory = None,
) -> None:
    """Take everything of that name, or one credential by its id, out of force. Open streams end, too."""
    settings, where = _place(config, directory)
    for each in Keeper(where, settings.name).revoke(name_or_id):
        typer.echo(f"revoked: {each.credential_id}, {each.role.value} {each.name}")


@app.command()
def rotate(
    what: Annotated[str, typer.Argument(metavar="NAME|ID|server|ca", help="Whose, or which certificate.")],
    *,
    config: Config = None,
    directory: Directory = None,
    host: Hosts = None,
    overlap_hours: Annotated[
        float, typer.Option(min=0, max=8760, help="How long the old one stays valid.")
    ] = 0,
    out: Out = None,
) -> None:
    """Replace somebody's credential, the gateway's certificate, or the authority by a new one."""
    settings, where = _place(config, directory)
    keeper = Keeper(where, settings.name)
    hosts = with_local(host) if host else None
    if what == "server":
        known = keeper.rotate_server(hosts)
        _say(f"new certificate, good for {', '.join(known)}. Laptops need nothing.")
    elif what == "ca":
        for each in keeper.rotate_authority(hosts):
            _say(f"revoked, because the old authority had signed it: {each.credential_id}, {each.name}")
        _say("new authority. Tokens stay. On each laptop:  robotctl login NAME --ca FILE, with this:")
        typer.echo(keeper.authority_bundle().authority.decode(), nl=False)
    else:
        credential, bundle = keeper.rotate(what, round(overlap_hours * 3600))
        _hand_over(credential, bundle, out, settings)


def _place(config: Path | None, directory: Path | None) -> tuple[GatewaySettings, CredentialDirectory]:
    settings = load_settings(config)
    where = directory or settings.security.credentials
    if where is None:
        raise UserError(
            "where the credentials are is not known",
            "Name it: --directory DIR, or security.credentials in the file that --config names",
            exit_code=ExitCode.USAGE,
        )
    return settings, CredentialDirectory(where)


def _asked_for(settings: GatewaySettings, where: CredentialDirectory) -> bool:
    """Whether a gateway with these settings asks a network's callers for these credentials already."""
    return settings.security.credentials == where.path and not is_loopback(settings.grpc.host)


def _hand_over(credential: Credential, bundle: Bundle, out: Path | None, settings: GatewaySettings) -> None:
    """The login to standard output or into a file, everything else to standard error."""
    if out:
        write_private(out, bundle.text().encode())
    else:
        typer.echo(bundle.text(), nl=False)
    given = out or "FILE"
    _say(
        f"{credential.kind.value} {credential.credential_id} for {credential.name}, {credential.role.value}"
        + (f", until {_day(credential.ends_s)}" if credential.ends_s else ""),
        f"On the laptop:  robotctl login ROBOT HOST:{settings.grpc.port} {given}",
        "The login is a secret: hand it over on a way that nobody else reads, and delete the file then.",
    )


def _say(*lines: str) -> None:
    """For the person, beside what is printed for the laptop."""
    for line in lines:
        typer.echo(line, err=True)


def _day(instant_s: int | None) -> str:
    return "-" if instant_s is None else datetime.fromtimestamp(instant_s, UTC).strftime("%Y-%m-%d %H:%M")


def _as_json(credential: Credential, now_s: float) -> dict[str, Any]:
    return {
        "id": credential.credential_id,
        "name": credential.name,
        "role": credential.role.value,
        "kind": credential.kind.value,
        "state": credential.state(now_s).value,
        "made_unix_ms": credential.made_s * _MS_PER_S,
        "begins_unix_ms": _ms(credential.begins_s),
        "ends_unix_ms": _ms(credential.ends_s),
        "revoked_unix_ms": _ms(credential.revoked_s),
    }


def _ms(instant_s: int | None) -> int | None:
    return None if instant_s is None else instant_s * _MS_PER_S
