"""robotctl fleet events: what happened to all robots, from the hub."""

import asyncio
import re
from datetime import UTC, datetime, timedelta
from typing import Annotated, Final

import typer

from common.errors import ExitCode, UserError
from console.cli.fleet_session import FleetSession, with_fleet
from console.cli.fleet_tables import item_line
from console.cli.loop_signals import ENDING, handled
from console.cli.options import ClientsOption, FollowOption, SeverityOption
from console.cli.session import print_json
from console.client.results import FaultSeverity
from console.fleet.values import EventsDropped, FleetItem, RobotEvent, Unreadable
from console.presentation.json_form import json_form

NEW: Final = "new"
"""As --since: only what the hub takes from now on."""
_AGO: Final = re.compile(r"(\d{1,6})([smhd])")
_UNITS: Final = {"s": "seconds", "m": "minutes", "h": "hours", "d": "days"}
_ORDER: Final = (FaultSeverity.INFO, FaultSeverity.WARNING, FaultSeverity.ERROR)


@with_fleet
def events(
    session: FleetSession,
    *,
    robot: Annotated[
        str, typer.Argument(metavar="[ROBOT]", help="One robot.", show_default="all robots")
    ] = "",
    follow: FollowOption = False,
    since: Annotated[
        str,
        typer.Option(
            "--since",
            metavar="TIME",
            help="30m, 6h or 2d ago, a time in UTC: 2026-11-22T09:30, or with --follow: new.",
        ),
    ] = "1d",
    severity: SeverityOption = "info",
    clients: ClientsOption = False,
) -> None:
    """Show past events of all robots or one, as the hub has them; gaps are shown as what they are.

    With --follow also new ones, each once, across lost connections.
    """
    if since.strip() == NEW and not follow:
        raise UserError(
            "--since new shows no event of the past, and without --follow there are no others",
            "Type: robotctl fleet events --follow --since new",
            exit_code=ExitCode.USAGE,
        )
    ago_or_time = None if since.strip() == NEW else parse_since(since)
    asyncio.run(_events(session, robot, ago_or_time, follow=follow, severity=severity, clients=clients))


def parse_since(text: str) -> timedelta | datetime:
    """Returns how long ago, or the time in UTC, that a text says.

    Raises:
        UserError: It says neither (a wrong command line).
    """
    if ago := _AGO.fullmatch(text.strip()):
        return timedelta(**{_UNITS[ago[2]]: int(ago[1])})
    try:
        found = datetime.fromisoformat(text)
        return (found if found.tzinfo else found.replace(tzinfo=UTC)).astimezone(UTC)
    except (ValueError, OverflowError):
        raise UserError(
            f"--since {text} is no time",
            "Write 30m, 6h or 2d, a time in UTC (2026-11-22 or 2026-11-22T09:30), or with --follow: new",
            exit_code=ExitCode.USAGE,
        ) from None


def is_shown(item: FleetItem, least: FaultSeverity, *, clients: bool) -> bool:
    """Returns whether a filter leaves an item in: gaps that may hide something stay."""
    match item:
        case RobotEvent(event=event):
            if event.is_presence and not clients:
                return False
            return event.severity not in _ORDER or _ORDER.index(event.severity) >= _ORDER.index(least)
        case EventsDropped(worst_severity=worst):
            return worst not in _ORDER or _ORDER.index(worst) >= _ORDER.index(least)
        case Unreadable():
            return True


async def _events(
    session: FleetSession,
    robot: str,
    since: timedelta | datetime | None,
    *,
    follow: bool,
    severity: str,
    clients: bool,
) -> None:
    from console.fleet.hub import EventQuery, read_events  # noqa: PLC0415 - needs the extra `fleet`
    from fleet.clock import read_clock  # noqa: PLC0415 - the same

    least = FaultSeverity(severity)
    task = asyncio.current_task()
    assert task  # noqa: S101 - this is one
    signals = dict.fromkeys(ENDING, task.cancel) if follow else {}
    try:
        with handled(signals):
            async with session.connect() as hub:
                since_unix_ms = None if since is None else _unix_ms(since, (await read_clock(hub)).unix_ms())
                query = EventQuery(robot, since_unix_ms, follow)
                async for item in read_events(hub, query):
                    if is_shown(item, least, clients=clients or session.as_json):
                        _show(session, item)
    except asyncio.CancelledError:
        if not follow:
            raise


def item_json(item: FleetItem) -> dict[str, object]:
    """Returns the JSON form of an item: of its three keys one is not null."""
    kinds = {"event": RobotEvent, "gap": EventsDropped, "unreadable": Unreadable}
    return {name: json_form(item) if isinstance(item, kind) else None for name, kind in kinds.items()}


def _show(session: FleetSession, item: FleetItem) -> None:
    if session.as_json:
        print_json(session.out, item_json(item), on_one_line=True)
    else:
        session.out.print(item_line(item), soft_wrap=True)
        session.out.file.flush()


def _unix_ms(since: timedelta | datetime, now_unix_ms: int) -> int:
    if isinstance(since, datetime):
        return round(since.timestamp() * 1000)
    return now_unix_ms - round(since.total_seconds() * 1000)
