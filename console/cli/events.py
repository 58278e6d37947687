"""robotctl events: past events of the robot and, with --follow, new ones."""

from collections.abc import Iterator
from typing import Annotated

import typer
from rich.text import Text

from common.errors import ExitCode, UserError
from console.cli.error_report import error_as_json
from console.cli.options import ClientsOption, FollowOption, SeverityOption
from console.cli.session import Session, print_json, with_session
from console.cli.stopping import until_stopped
from console.cli.tables import STYLES
from console.client import CaughtUp, Event, EventGap, EventPosition, FaultSeverity, Outage
from console.client.results import GapReason
from console.presentation.formatting import plural, wall_clock, without_component
from console.presentation.json_form import json_form
from console.presentation.severity_style import FAULT_STYLES

"""With the time zone, which the robot's log may not share."""


@with_session
def events(
    session: Session,
    *,
    follow: FollowOption = False,
    since: Annotated[
        str | None,
        typer.Option("--since", metavar="RUN:SEQUENCE", help="Resume after this event.", show_default=False),
    ] = None,
    severity: SeverityOption = "info",
    clients: ClientsOption = False,
) -> None:
    """Show past events of the robot, as far back as the gateway keeps them.

    With --follow also new ones, each once, across lost connections.
    """
    after = _position(since)
    least = FaultSeverity.UNKNOWN if severity == "info" else FaultSeverity(severity)
    with session.connect() as gateway, until_stopped(gateway.close) as stopped:
        for item in stopped.as_end_of(gateway.events(after, least=least)):
            if isinstance(item, CaughtUp):
                if not follow:
                    return
            elif isinstance(item, Outage) and not follow:
                # Without --follow the past events are all that was asked for.
                raise item.error
            elif clients or session.as_json or not (isinstance(item, Event) and item.is_presence):
                _show(session, item)


def _show(session: Session, item: Event | EventGap | Outage) -> None:
    if not session.as_json:
        session.out.print(Text("  ").join(_columns(item)), soft_wrap=True)
        return
    document = {
        "event": json_form(item) if isinstance(item, Event) else None,
        "gap": json_form(item) if isinstance(item, EventGap) else None,
        "error": error_as_json(item.error) if isinstance(item, Outage) else None,
    }
    print_json(session.out, document, on_one_line=True)


def _columns(item: Event | EventGap | Outage) -> Iterator[Text]:
    match item:
        case Event():
            yield Text(f"{wall_clock(item.wall_clock_unix_ms):24}", style="dim")
            loud = item.severity in (FaultSeverity.WARNING, FaultSeverity.ERROR)
            style = STYLES[FAULT_STYLES[item.severity]] if loud else ""
            yield Text(f"{item.severity.value:7}", style=style)
            yield Text(f"{item.component:10}")
            yield Text(without_component(item.component, item.message))
        case EventGap():
            yield Text(f"--- {_missing(item)}", style="bold yellow")
        case Outage():
            yield Text(f"--- {item.error.what}", style="bold red")


def _missing(gap: EventGap) -> str:
    if gap.reason is GapReason.NEW_RUN:
        here = f", and {plural(gap.missed_count, 'event')} of this run" if gap.missed_count else ""
        return f"the gateway was restarted: events that it had not sent before are lost{here}"
    return f"{plural(gap.missed_count, 'event')} missing: there were more than the gateway keeps"


def _position(text: str | None) -> EventPosition | None:
    if text is None:
        return None
    run_id, _, sequence = text.rpartition(":")
    if not run_id or not sequence.isdecimal():
        raise UserError(
            f"--since {text} is not an event position",
            "It has the form RUN:SEQUENCE; 'robotctl events --json' prints both with each event",
            exit_code=ExitCode.USAGE,
        )
    return EventPosition(run_id, int(sequence))
