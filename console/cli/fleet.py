"""robotctl fleet: all robots of a fleet, by its hub."""

import asyncio
import getpass
import shlex
import socket
import sys
from contextlib import suppress
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

import typer

from common.errors import ExitCode, UserError
from console.cli.export_options import naming_export_options
from console.cli.fleet_events import events
from console.cli.fleet_session import FleetSession, HubUnreachableError, with_fleet
from console.cli.fleet_tables import answer_line, fleet_view, recordings_table, robot_view
from console.cli.fleet_watch import fleet_json, watch
from console.cli.login import STANDARD_INPUT, login_text
from console.cli.options import JsonOption, json_requested
from console.cli.recording_tables import exported_json
from console.cli.session import Session, print_json, standard_output
from console.cli.transfer_bar import TransferBar
from console.client.export_path import path_below
from console.client.exporting import Export, ExportedRecording, ExportOptions
from console.fleet.login import fleet_login_path, keep_fleet_login
from console.fleet.values import CommandAnswer, CommandOutcome, FleetRow, StoredRecording, Unreadable
from console.presentation.formatting import age
from console.presentation.json_form import json_form
from console.presentation.recording import exported
from console.robots import Robot, read_robots_file
from console.target import parse_target
from fleet.standing import Standing

if TYPE_CHECKING:
    from omniseer.fleet.v1.command_pb2 import Command

fleet_app = typer.Typer(
    help="Show all robots of a fleet, by its hub, without asking any of them.",
    add_completion=False,
    rich_markup_mode=None,
)
fleet_app.command("watch")(watch)
fleet_app.command("events")(events)

_REACHED_WITHIN_S: Final = 3.0
_MOST_EXPIRY_S: Final = 86_400
ANSWER_AFTER_EXPIRY_S: Final = 10.0
"""A command that was begun in time may take so long to be answered."""
RobotArgument = Annotated[str, typer.Argument(metavar="ROBOT", help="Its name in the fleet.")]


@fleet_app.command("list")
@with_fleet
def list_all(session: FleetSession) -> None:
    """Show all robots at a glance, once: who is up, since when, faults, battery, disk, uploads."""
    rows = asyncio.run(_rows(session))
    session.show(fleet_json(rows), fleet_view(rows, session.out.width))


@fleet_app.command("show")
@with_fleet
def show(session: FleetSession, *, robot: RobotArgument) -> None:
    """Show one robot as its hub has it: faults, battery, uploads, and the values of its configuration."""
    row = _row(asyncio.run(_rows(session)), robot)
    session.show(json_form(row), robot_view(row))


@fleet_app.command("recordings")
@with_fleet
def recordings(
    session: FleetSession,
    *,
    robot: Annotated[
        str, typer.Argument(metavar="[ROBOT]", help="One robot.", show_default="all robots")
    ] = "",
) -> None:
    """List the recordings in the hub's store, the newest first, with their receipts checked."""
    found = [item for item in asyncio.run(_recordings(session, robot)) if robot in ("", item.robot)]
    session.show(
        recordings_json(found), recordings_table(found) if found else "No recording was uploaded yet."
    )


@fleet_app.command("get")
@with_fleet
def get(
    session: FleetSession,
    *,
    robot: RobotArgument,
    recording_id: Annotated[
        str, typer.Argument(metavar="ID", help="The recording, as `robotctl fleet recordings` names it.")
    ],
    to: Annotated[
        Path, typer.Option("--to", metavar="DIR", help="Where its folder is made.", show_default="here")
    ] = Path(),
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with what an earlier copy has left.")
    ] = False,
    store_ca: Annotated[
        Path | None,
        typer.Option(
            "--store-ca", metavar="FILE", help="Authority of the store.", show_default="those of the system"
        ),
    ] = None,
) -> None:
    """Copy a verified recording from the hub's store, into the folder DIR/ROBOT/ID, and verify it again.

    The robot is not asked, and need not be on. The copy goes on by itself when the connection was cut.
    """
    try:
        done = asyncio.run(_get(session, robot, recording_id, to, resume=resume, store_ca=store_ca))
    except KeyboardInterrupt:
        authority = ["--store-ca", str(store_ca)] if store_ca else []
        words = ["fleet", "get", robot, recording_id, "--to", str(to), "--resume", *authority]
        print(f"What was received stays. To go on, type: robotctl {shlex.join(words)}", file=sys.stderr)
        raise
    session.show({"ok": True, **exported_json(done)}, exported(done))


@fleet_app.command("command")
@with_fleet
def command(
    session: FleetSession,
    *,
    robot: RobotArgument,
    action: Annotated[Literal["snapshot", "upload"], typer.Argument(help="What to do.")],
    recording_id: Annotated[
        str, typer.Argument(metavar="[ID]", help="Of upload: the recording.", show_default=False)
    ] = "",
    label: Annotated[
        str, typer.Option("--label", metavar="TEXT", help="Of snapshot: a name for people.")
    ] = "",
    before: Annotated[
        int | None,
        typer.Option("--before", metavar="SECONDS", min=0, max=3600, help="Of snapshot: seconds until now."),
    ] = None,
    after: Annotated[
        int | None,
        typer.Option("--after", metavar="SECONDS", min=0, max=600, help="Of snapshot: seconds from now on."),
    ] = None,
    expires_s: Annotated[
        int,
        typer.Option(
            "--expires", metavar="SECONDS", min=1, max=_MOST_EXPIRY_S, help="How long it may still be begun."
        ),
    ] = 60,
) -> None:
    """Request a snapshot or an upload of a robot, and wait for its answer.

    A robot carries it out only if its own configuration allows it, and never after it has expired.
    """
    if (action == "upload") != bool(recording_id):
        what = "upload needs the ID of a recording" if action == "upload" else "snapshot takes no ID"
        raise UserError(what, "Type: robotctl fleet command --help", exit_code=ExitCode.USAGE)
    from console.fleet.wire import snapshot_command, upload_command  # noqa: PLC0415 - the extra `fleet`

    wanted = (
        upload_command(recording_id)
        if action == "upload"
        else snapshot_command(pre_s=before, post_s=after, label=label)
    )
    answered = asyncio.run(_command(session, robot, wanted, expires_s))
    session.show(
        {"ok": answered.outcome is CommandOutcome.DONE, **json_form(answered)}, answer_line(answered)
    )
    if answered.outcome is not CommandOutcome.DONE:
        raise typer.Exit(int(ExitCode.FAILED))


@fleet_app.command("monitor")
@with_fleet
def monitor(session: FleetSession, *, robot: RobotArgument) -> None:
    """Open the monitor of a robot that can be reached from here.

    A robot that `robotctl robots` lists is opened as it is there, any other one where it says that it is.
    """
    known = read_robots_file().robots.get(robot)
    target = known.target if known else _reported_target(_row(asyncio.run(_rows(session)), robot))
    _require_reachable(robot, target)
    from console.cli.windows import open_monitor  # noqa: PLC0415 - imports what video needs

    shown = Session(known or Robot(target=target), False, session.out, robot if known else None)
    open_monitor(lambda: shown)


@fleet_app.command("login")
def login(
    context: typer.Context,
    file: Annotated[
        str, typer.Argument(metavar="FILE", help="File with the login; - is standard input.")
    ] = STANDARD_INPUT,
    *,
    replacing: Annotated[
        bool, typer.Option("--replace", help="Store it over the present one.", show_default=False)
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Store a login for a fleet, issued by the hub's administrator, for all later commands."""
    path = fleet_login_path()
    if path.exists() and not replacing:
        raise UserError(
            f"there is a login for a fleet already, in {path}",
            f"Type: {shlex.join(['robotctl', *sys.argv[1:], '--replace'])}",
            exit_code=ExitCode.USAGE,
        )
    stored = keep_fleet_login(login_text(file))
    out = standard_output()
    if json_requested(context, as_json):
        print_json(out, {"fleet": stored.fleet, "name": stored.name, "servers": list(stored.servers)})
        return
    out.print(f"Fleet {stored.fleet}: stored in {path}.\nType: robotctl fleet list", soft_wrap=True)


def recordings_json(found: list[StoredRecording | Unreadable]) -> dict[str, Any]:
    """Returns the JSON form of the recordings in the store."""
    return {
        "recordings": [json_form(item) for item in found if isinstance(item, StoredRecording)],
        "unreadable": [json_form(item) for item in found if isinstance(item, Unreadable)],
    }


async def _rows(session: FleetSession) -> tuple[FleetRow, ...]:
    # The extra `fleet` may not be installed: `with_fleet` has found out. So below.
    from console.fleet.hub import read_board  # noqa: PLC0415
    from fleet.clock import read_clock  # noqa: PLC0415

    async with session.connect() as hub:
        board = await read_board(hub)
        # After the states, none of which is then of the future.
        clock = await read_clock(hub)
        return board.rows(clock.unix_ms())


async def _recordings(session: FleetSession, robot: str) -> list[StoredRecording | Unreadable]:
    from console.fleet.hub import read_recordings  # noqa: PLC0415

    login = session.login
    async with session.connect() as hub:
        return await read_recordings(hub, login.fleet, login.receivers, robot)


async def _get(
    session: FleetSession, robot: str, recording_id: str, to: Path, *, resume: bool, store_ca: Path | None
) -> ExportedRecording:
    from console.fleet.fetching import ReceiverUrls, read_verified, tls_context  # noqa: PLC0415
    from console.fleet.store import StoreTransport  # noqa: PLC0415

    login, tls = session.login, tls_context(store_ca)
    async with session.connect() as hub:
        found = await read_verified(
            hub, login.fleet, login.receivers, robot=robot, recording_id=recording_id, tls=tls
        )
        folder = path_below(to, f"{robot}/{found.id}")
        urls = ReceiverUrls(hub, robot, recording_id)
        # Where there is no receiver, that is said at once; one that is lost later is waited for.
        await urls.url(found.files[0].name)
        transport = StoreTransport({file.name: file for file in found.files}, urls, tls)
        with TransferBar(session.out, shown=not session.as_json) as bar, naming_export_options():
            return await Export(
                transport, found, folder, ExportOptions(resume=resume, progress=bar.show_export)
            ).run()


async def _command(session: FleetSession, robot: str, wanted: "Command", expires_s: int) -> CommandAnswer:
    from console.fleet.hub import answer, read_board, send_command  # noqa: PLC0415
    from fleet.clock import read_clock  # noqa: PLC0415

    async with session.connect() as hub:
        board, clock = await read_board(hub), await read_clock(hub)
        row = _row(board.rows(clock.unix_ms()), robot)
        if row.standing is Standing.REVOKED:
            raise UserError(f"the credential of {robot} is revoked: it would never get the command")
        if row.standing is not Standing.UP and not session.as_json:
            print(_why_it_may_wait(row, expires_s), file=sys.stderr)
        issued_by = session.login.name or f"{getpass.getuser()}@{socket.gethostname()}"
        command_id = await send_command(hub, clock, robot, wanted, issued_by=issued_by, expires_s=expires_s)
        with suppress(TimeoutError):
            async with asyncio.timeout(expires_s + ANSWER_AFTER_EXPIRY_S):
                found = await answer(hub, robot, command_id)
                if isinstance(found, Unreadable):
                    raise UserError(f"the answer of {robot} is unreadable: {found.problem}")
                return found
    raise HubUnreachableError(
        f"{robot} has not answered the command before it expired",
        "A robot that is away refuses it when it is back; one that had it in time may have begun it. Before "
        f"you repeat it, type: robotctl fleet recordings {robot}",
        exit_code=ExitCode.UNREACHABLE,
    )


def _row(rows: tuple[FleetRow, ...], robot: str) -> FleetRow:
    for row in rows:
        if row.robot == robot:
            return row
    meant = get_close_matches(robot, [row.robot for row in rows], n=1)
    raise UserError(
        f"no robot of the fleet is called '{robot}'",
        f"Did you mean '{meant[0]}'?" if meant else "Type: robotctl fleet list",
        exit_code=ExitCode.USAGE,
    )


def _why_it_may_wait(row: FleetRow, expires_s: int) -> str:
    seen = f", last seen {age(row.last_seen_ms)} ago" if row.last_seen_ms is not None else ""
    return f"{row.robot} is {row.standing.value}{seen}; the command waits for it for {expires_s} s"


def _reported_target(row: FleetRow) -> str:
    if row.state is None or not row.state.gateway_target:
        raise UserError(
            f"{row.robot} does not report where its gateway is",
            "Set 'advertised_target' in the robot's bridge.yaml, or type: "
            f"robotctl robots add {row.robot} HOST:PORT",
        )
    try:
        return parse_target(row.state.gateway_target)
    except UserError as error:
        raise UserError(f"{row.robot} reports no address of a gateway: {error.what}", error.remedy) from error


def _require_reachable(robot: str, target: str) -> None:
    host, _, port = target.rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), int(port)), _REACHED_WITHIN_S).close()
    except OSError as error:
        raise HubUnreachableError(
            f"the gateway of {robot} can't be reached from here at {target}: {error.strerror or error}",
            "The hub passes on no connections: use a network that has a way to the robot, a VPN for example",
            exit_code=ExitCode.UNREACHABLE,
        ) from error
