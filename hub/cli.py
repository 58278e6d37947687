"""`robot-bridge hub`: makes a hub, enrolls and revokes robots, issues credentials."""

import asyncio
import json
from collections.abc import Coroutine
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Final, TypeAlias, TypeVar

import typer
from rich.console import Console
from rich.table import Table

from common import config
from common.addresses import is_loopback
from common.errors import ExitCode, UserError
from fleet.connection import FleetAddress
from fleet.errors import HubError, HubReason
from fleet.servers import exposed_server
from hub import administration, receipts
from hub.accounts import refresh_nodes
from hub.creation import HubPlan, create
from hub.directory import HubDirectory, Kind, User
from hub.jetstream.streams import EVENTS_BYTES, EVENTS_DAYS, RECORDINGS_BYTES, StreamLimits
from hub.receiver.cli import Config, receiver
from hub.receiver.config import ReceiverSettings
from hub.server_config import Node, Places

app = typer.Typer(help="The fleet's hub: make it, enroll robots, revoke them.", no_args_is_help=True)

_DEFAULT_DIR: Final = Path("fleet-hub")
_MIB: Final = 1024 * 1024
ResultT = TypeVar("ResultT")
Dir: TypeAlias = Annotated[
    Path, typer.Option("--dir", envvar="ROBOT_HUB_DIR", help="The directory that init has made.")
]
Days: TypeAlias = Annotated[
    float | None,
    typer.Option(min=0.0001, max=36500, help="Validity in days. Without: until it is revoked."),
]
Again: TypeAlias = Annotated[bool, typer.Option("--again", help="New credentials; the old ones end at once.")]


@app.command()
def init(
    out: Annotated[Path, typer.Option("--out", help="A directory that does not exist yet.")] = _DEFAULT_DIR,
    *,
    nodes: Annotated[int, typer.Option(min=1, max=3, help="Servers: 1, or 3 for a cluster.")] = 1,
    fleet: Annotated[str, typer.Option(help="The fleet's name.")] = "fleet",
    host: Annotated[
        list[str] | None,
        typer.Option(help="Name or address of a server, as robots reach it; once for each server."),
    ] = None,
    store: Annotated[str, typer.Option(help="Disk space for streams on each server.")] = "32GB",
    old_server: Annotated[
        bool, typer.Option("--server-2.9", help="For nats-server 2.9, which can't sync each message.")
    ] = False,
) -> None:
    """Create keys, certificates and the servers' configuration. Needs no server."""
    hosts = host or (["localhost"] if nodes == 1 else [])
    if nodes == 2 or len(hosts) != nodes:  # two servers have no majority when one is lost
        raise UserError(
            f"{nodes} servers need as many times --host, and a cluster has three",
            "Type: robot-bridge hub init --nodes 3 --host hub1 --host hub2 --host hub3",
            exit_code=ExitCode.USAGE,
        )
    plan = HubPlan(
        fleet=fleet,
        nodes=tuple(Node(f"n{position}", name) for position, name in enumerate(hosts, 1)),
        places=Places(),
        max_store=store,
        sync_always=not old_server,
    )
    create(HubDirectory(out), plan)
    typer.echo(f"{out}: created the keys of the fleet '{fleet}'. Keep it secret, and keep a backup.")
    for node in plan.nodes:
        typer.echo(f"Copy {out}/nodes/{node.name} to {node.host} as /etc/nats, and start nats-server there.")
    typer.echo(f"Then:  robot-bridge hub apply --dir {out}")


@app.command()
def apply(
    directory: Dir = _DEFAULT_DIR,
    events_mib: Annotated[
        int | None, typer.Option(min=1, help=f"Room for events, in MiB; {EVENTS_BYTES // _MIB} at first.")
    ] = None,
    events_days: Annotated[
        int | None, typer.Option(min=1, max=3650, help=f"How long events are kept; {EVENTS_DAYS} at first.")
    ] = None,
    recordings_mib: Annotated[
        int | None,
        typer.Option(
            min=1, help=f"Room for the list of recordings, in MiB; {RECORDINGS_BYTES // _MIB} at first."
        ),
    ] = None,
) -> None:
    """Create what is missing at the hub, make more room where that is asked for, repeat revocations.

    Ends 1 when existing streams differ.
    """
    limits = StreamLimits(
        events_mib and events_mib * _MIB, events_days, recordings_mib and recordings_mib * _MIB
    )
    hub = HubDirectory(directory)
    # Before the servers are asked: an attempt that fails would not say it again.
    administration.move_people(hub, lambda user: typer.echo(_moved(user, hub)))
    differences = _run(administration.apply(hub, limits))
    _refresh_nodes(hub)
    for difference in differences:
        typer.echo(difference)
    if differences:
        typer.echo("These were left as they are (less room costs messages). Change them with the tool nats.")
        raise typer.Exit(int(ExitCode.FAILED))
    typer.echo("The hub is ready. Next:  robot-bridge hub enroll ROBOT --out DIR")


@app.command()
def enroll(
    name: Annotated[str, typer.Argument(help="Of the robot: letters, digits and hyphens.")],
    out: Annotated[Path, typer.Option("--out", help="Where the robot's files go.")],
    directory: Dir = _DEFAULT_DIR,
    days: Days = None,
    again: Again = False,
) -> None:
    """Enroll a robot: its keys, its commands, its place in the list."""
    hub = HubDirectory(directory)
    try:
        _run(administration.enroll(hub, name, out, days=days, again=again))
    finally:
        if again:
            _refresh_nodes(hub)  # As in `revoke`.
    typer.echo(
        f"{name} is enrolled. Copy {out} to the robot, and point bridge.yaml at it; then delete it here."
    )


@app.command()
def revoke(
    name: Annotated[str, typer.Argument(help="Of the robot, person or receiver.")],
    directory: Dir = _DEFAULT_DIR,
    operator: Annotated[bool, typer.Option("--operator", help="A person, not a robot.")] = False,
    receiver: Annotated[bool, typer.Option("--receiver", help="A receiver, not a robot.")] = False,
) -> None:
    """Make all credentials invalid; connections end at once."""
    if operator and receiver:
        raise UserError(
            f"'{name}' is either a person or a receiver",
            "Leave out --operator or --receiver",
            exit_code=ExitCode.USAGE,
        )
    kind: Kind = "operator" if operator else "receiver" if receiver else "robot"
    hub = HubDirectory(directory)
    try:
        _run(administration.revoke(hub, kind, name))
    finally:
        # Also where the servers could not be reached: those that are down read it when they start.
        _refresh_nodes(hub)
    typer.echo(f"{name} is revoked.")


@app.command()
def robots(
    directory: Dir = _DEFAULT_DIR,
    everyone: Annotated[bool, typer.Option("--all", help="People and receivers as well.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="For programs (docs/fleet.md).")] = False,
) -> None:
    """List who is enrolled. Needs no server."""
    users = [each for each in HubDirectory(directory).read().users if everyone or each.kind == "robot"]
    users.sort(key=lambda each: (each.kind, each.name))
    if as_json:
        found = [
            {"name": each.name, "kind": each.kind, "key": each.keys[-1], "revoked_unix_s": each.revoked}
            for each in users
        ]
        typer.echo(json.dumps(found, indent=2))
        return
    table = Table("NAME", "KIND", "REVOKED", "KEY", box=None)
    for each in users:
        revoked = (
            datetime.fromtimestamp(each.revoked, UTC).strftime("%Y-%m-%d %H:%M UTC") if each.revoked else "-"
        )
        table.add_row(each.name, each.kind, revoked, each.keys[-1][:12])
    Console(highlight=False, markup=False, emoji=False).print(table)


@app.command()
def usage(directory: Dir = _DEFAULT_DIR) -> None:
    """Show how full the streams are, and which robot fills them."""
    use = _run(administration.usage(HubDirectory(directory)))
    console = Console(highlight=False, markup=False, emoji=False)
    table = Table("STREAM", "MIB", "OF", "FULL", box=None)
    for each in use.streams:
        table.add_row(
            each.stream, f"{each.size / _MIB:.1f}", f"{each.most // _MIB}", f"{100 * each.ratio:.0f} %"
        )
    console.print(table)
    table = Table("ROBOT", "MESSAGES WITH EVENTS", box=None)
    for robot, count in use.events:
        table.add_row(robot, str(count))
    console.print(table)


@app.command()
def purge(
    name: Annotated[str, typer.Argument(help="Of the robot.")],
    directory: Dir = _DEFAULT_DIR,
    *,
    recordings: Annotated[
        bool, typer.Option("--recordings", help="Its list of recordings, too. The files stay in the store.")
    ] = False,
) -> None:
    """Delete a robot's events and results at the hub, for ever. Revoke it first if its key is stolen."""
    purged = _run(administration.purge(HubDirectory(directory), name, recordings=recordings))
    for stream, count in purged.items():
        typer.echo(f"{stream}: deleted {count} messages of {name}.")


@app.command()
def operator(
    name: Annotated[str, typer.Argument(help="Of the person.")],
    directory: Dir = _DEFAULT_DIR,
    *,
    commands: Annotated[bool, typer.Option("--commands", help="May send robots commands, too.")] = False,
    out: Annotated[
        Path | None, typer.Option("--out", help="For a program instead, the exporter: where its files go.")
    ] = None,
    days: Days = None,
    again: Again = False,
) -> None:
    """Print a login for a person: robotctl fleet login FILE. With --out, write the files of a program."""
    hub = HubDirectory(directory)
    if out:
        if commands:
            raise UserError(
                "programs that read the hub send no commands",
                "Leave out --commands, or --out for a person",
                exit_code=ExitCode.USAGE,
            )
        administration.operator_files(hub, name, out, days=days, again=again)
        _end_old(hub, again=again)
        typer.echo(f"{out}: credentials of a program that reads the hub.")
        return
    login = administration.operator_login(hub, name, commands=commands, days=days, again=again)
    _end_old(hub, again=again)
    typer.echo(login, nl=False)


@app.command("receiver-credentials")
def receiver_credentials(
    out: Annotated[Path, typer.Option("--out", help="Where the files go.")],
    name: Annotated[str, typer.Option(help="Of the receiver.")] = "receiver",
    directory: Dir = _DEFAULT_DIR,
    days: Days = None,
    again: Again = False,
) -> None:
    """Write the files of a receiver of recordings."""
    hub = HubDirectory(directory)
    administration.receiver_files(hub, name, out, days=days, again=again)
    _end_old(hub, again=again)
    typer.echo(f"{out}: credentials and signing key of the receiver.")


receipts_app = typer.Typer(help="The key that receivers sign receipts with.", no_args_is_help=True)
app.add_typer(receipts_app, name="receipts")


@receipts_app.command("rotate")
def rotate_receipts(directory: Dir = _DEFAULT_DIR) -> None:
    """Make a new key that receivers are to sign with; the old ones still count. Needs no server."""
    count = receipts.rotate(HubDirectory(directory))
    typer.echo(
        f"{directory}: a new key of receipts; {count} count now. In this order:\n"
        f"1. {directory}/receipts.pub to each robot (hub.receipts) and each receiver (receipt_keys), and\n"
        "   restart them; for each person a new login: robot-bridge hub operator NAME --again\n"
        f"2. {directory}/receipts.key to each receiver (signing_key), and restart it\n"
        f"3. if the old key was stolen: robot-bridge hub receipts retire --dir {directory}"
    )


@receipts_app.command("retire")
def retire_receipts(directory: Dir = _DEFAULT_DIR) -> None:
    """Let the newest key alone count from now on, after it has come everywhere. Needs no server."""
    count = receipts.retire(HubDirectory(directory))
    typer.echo(
        f"{directory}/receipts.pub: {count} old keys were removed. Copy it to each robot and receiver,\n"
        "restart them, and make new logins (--again). What old keys have signed is not confirmed any more."
    )


@app.command()
def relist(config_file: Config = None) -> None:
    """List again what the store has verified, by the configuration of a receiver: after a lost disk."""
    from hub.receiver.relisting import relist  # noqa: PLC0415 - boto3

    done = _run(relist(config.load(ReceiverSettings, config_file)))
    typer.echo(f"Listed {done.listed} recordings.")
    for each in done.left_out:
        typer.echo(
            f"{each} is not listed: no receipt that counts, or files are missing in the store.", err=True
        )
    if done.left_out:
        raise typer.Exit(int(ExitCode.FAILED))


@app.command()
def exporter(
    servers: Annotated[
        str,
        typer.Option(envvar="ROBOT_HUB_SERVERS", help="Of the hub, as tls://host:4222, separated by commas."),
    ],
    credentials: Annotated[
        Path | None, typer.Option(envvar="ROBOT_HUB_CREDENTIALS", help="An operator's NATS credentials.")
    ] = None,
    ca: Annotated[Path | None, typer.Option(envvar="ROBOT_HUB_CA", help="ca.pem of the hub.")] = None,
    *,
    host: Annotated[str, typer.Option(help="Address to serve the metrics on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Its port.")] = 9109,
    insecure: Annotated[
        bool,
        typer.Option("--insecure", help="Accept that others on the network can read them."),
    ] = False,
) -> None:
    """Serve the fleet's metrics for Prometheus, until Ctrl-C."""
    from hub.exporter.app import export_until_stopped  # noqa: PLC0415 - prometheus_client

    names = tuple(part.strip() for part in servers.split(",") if part.strip())
    if server := exposed_server(names, ca):
        raise UserError(
            f"--ca is missing: without it {server} can't be used, only nats:// to this machine",
            "Add --ca FILE, with the ca.pem of the hub",
            exit_code=ExitCode.USAGE,
        )
    if not (insecure or is_loopback(host)):
        raise UserError(
            f"--host is {host}: anyone on that network could read the metrics",
            "Use 127.0.0.1, or accept it with --insecure",
            exit_code=ExitCode.USAGE,
        )
    address = FleetAddress(names, credentials, ca, name="robot-bridge hub exporter")
    asyncio.run(export_until_stopped(address, host, port))


app.command("receiver")(receiver)


def _run(work: Coroutine[Any, Any, ResultT]) -> ResultT:
    """Runs some work with the hub.

    Raises:
        UserError: the hub did not do it.
    """
    try:
        return asyncio.run(work)
    except HubError as error:
        remedies = {
            HubReason.UNREACHABLE: "Check that the servers run, and that their names are reachable from here",
            HubReason.REFUSED: "Name the directory of this hub with --dir",
            HubReason.NO_QUORUM: "Start the other servers of the cluster, and try again",
            HubReason.NO_RESPONDERS: "Check that all servers run, each with its nats.conf of"
            " robot-bridge hub init, then type: robot-bridge hub apply",
        }
        code = ExitCode.UNREACHABLE if error.reason is HubReason.UNREACHABLE else ExitCode.FAILED
        raise UserError(str(error), remedies.get(error.reason, "Try again"), exit_code=code) from error


def _moved(user: User, hub: HubDirectory) -> str:
    """Returns what a person or receiver of an earlier version needs to know."""
    return (
        f"{user.name}: the credentials of this {user.kind} end now. Those of earlier versions could"
        f" delete what the hub has. For new ones type:  {_again(user, hub)}"
    )


def _again(user: User, hub: HubDirectory) -> str:
    """Returns what to type for new credentials."""
    if user.kind == "receiver":
        return f"robot-bridge hub receiver-credentials --name {user.name} --out DIR --again --dir {hub.path}"
    command = f"robot-bridge hub operator {user.name} --again --dir {hub.path}"
    return f"{command}  (a program, as the exporter: with --out DIR; a person with commands: --commands)"


def _end_old(hub: HubDirectory, *, again: bool) -> None:
    """Has the servers refuse what new credentials have replaced."""
    if again:
        try:
            _run(administration.push_revocations(hub))
        finally:
            _refresh_nodes(hub)  # As in `revoke`.


def _refresh_nodes(hub: HubDirectory) -> None:
    """Writes the revocations into the servers' configuration in the directory; says where that failed."""
    for problem in refresh_nodes(hub):
        typer.echo(
            f"{problem}. It lacks revocations: when its server has lost its disk, type"
            f"  robot-bridge hub apply --dir {hub.path}",
            err=True,
        )
