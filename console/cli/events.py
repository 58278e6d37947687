"""robotctl events: what happened on the robot, and with --follow what happens."""

from collections.abc import Iterator
from datetime import datetime
from enum import StrEnum
from typing import Annotated, Any, Final

import typer
from rich.text import Text

from common.errors import ExitCode, UserError
from console.cli.json_form import json_form
from console.cli.options import JsonOption, RobotOption, TargetOption, session_of
from console.cli.session import Session, error_as_json
from console.cli.stopping import until_stopped
from console.client import CaughtUp, Event, EventGap, EventPosition, FaultSeverity, Outage
from console.client.results import GapReason
from console.presentation.formatting import plural

Item = Event | EventGap | CaughtUp | Outage

_MS_PER_S: Final = 1000
_STYLES: Final = {FaultSeverity.WARNING: "bold yellow", FaultSeverity.ERROR: "bold red"}


class SeverityWord(StrEnum):
    """The least that can be asked for."""

    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


def events(
    context: typer.Context,
    *,
    follow: Annotated[bool, typer.Option("--follow", help="Go on until Ctrl-C.", show_default=False)] = False,
    since: Annotated[
        str | None,
        typer.Option("--since", metavar="RUN:SEQUENCE", help="Go on after this event.", show_default=False),
    ] = None,
    severity: Annotated[
        SeverityWord, typer.Option("--severity", help="Leave out what matters less.")
    ] = SeverityWord.INFO,
    target: TargetOption = None,
    robot: RobotOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show what happened on the robot, as far as the gateway keeps it.

    With --follow also what happens from now on, each event once, whatever becomes of the connection.
    """
    session = session_of(context, target, as_json, robot)
    after = _position(since)
    least = FaultSeverity.UNKNOWN if severity is SeverityWord.INFO else FaultSeverity(severity.value)
    with session.connect() as gateway, until_stopped(gateway.close) as stopped:
        for item in stopped.as_end_of(gateway.events(after, least=least)):
            if isinstance(item, CaughtUp):
                if not follow:
                    return
            elif isinstance(item, Outage) and not follow:
                # Who wants to know what was, and can't get it, has failed.
                raise item.error
            else:
                _show(session, item)


def _show(session: Session, item: Event | EventGap | Outage) -> None:
    if session.as_json:
        session.print_json(_document(item), on_one_line=True)
    else:
        session.out.print(Text("  ").join(_columns(item)), soft_wrap=True)


def _document(item: Event | EventGap | Outage) -> dict[str, Any]:
    return {
        "event": json_form(item) if isinstance(item, Event) else None,
        "gap": json_form(item) if isinstance(item, EventGap) else None,
        "error": error_as_json(item.error) if isinstance(item, Outage) else None,
    }


def _columns(item: Event | EventGap | Outage) -> Iterator[Text]:
    match item:
        case Event():
            at = datetime.fromtimestamp(item.wall_clock_unix_ms / _MS_PER_S).astimezone()
            yield Text(at.strftime("%Y-%m-%d %H:%M:%S"), style="dim")
            yield Text(f"{item.severity.value:7}", style=_STYLES.get(item.severity, ""))
            yield Text(f"{item.component:10}")
            yield Text(item.message)
        case EventGap():
            yield Text(f"--- {_missing(item)}", style="bold yellow")
        case Outage():
            yield Text(f"--- {item.error.what}", style="bold red")


def _missing(gap: EventGap) -> str:
    if gap.reason is GapReason.NEW_RUN:
        here = f", and of this run {plural(gap.missed_count, 'event')}" if gap.missed_count else ""
        return f"the gateway was started anew: what it had not sent before is missing{here}"
    return f"{plural(gap.missed_count, 'event')} missing: more came than the gateway keeps"


def _position(words: str | None) -> EventPosition | None:
    if words is None:
        return None
    run_id, _, sequence = words.rpartition(":")
    if not run_id or not sequence.isdecimal():
        raise UserError(
            f"--since {words} is no place in the order of events",
            "It has the form RUN:SEQUENCE; 'robotctl events --json' tells both with each event",
            exit_code=ExitCode.USAGE,
        )
    return EventPosition(run_id, int(sequence))
