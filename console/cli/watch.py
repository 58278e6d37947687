"""robotctl watch: the status on every change, redrawn on a terminal, line by line elsewhere."""

from datetime import UTC, datetime
from typing import Annotated

from console.cli.error_report import error_as_json
from console.cli.live_watch import watch_on_a_terminal
from console.cli.options import CountOption, interval_option
from console.cli.session import Session, print_json, with_session
from console.cli.stopping import until_stopped
from console.client import Outage, WatchedStatus
from console.presentation.json_form import json_form
from console.presentation.status_line import status_line


@with_session
def watch(
    session: Session,
    *,
    interval_s: Annotated[float, interval_option(0.1)] = 1.0,
    count: CountOption = None,
) -> None:
    """Show the status whenever it changes, until Ctrl-C.

    On a terminal it is redrawn in place; a pipe or a file gets one line per update.
    """
    if session.out.is_terminal and not session.as_json:
        watch_on_a_terminal(session, interval_s, count)
        return
    with session.connect() as robot, until_stopped(robot.close) as stopped:
        items = stopped.as_end_of(robot.watch_status(interval_s))
        for number, item in enumerate(items, start=1):
            (_print_json if session.as_json else _print_line)(session, item)
            if number == count:
                return


def _print_line(session: Session, item: WatchedStatus | Outage) -> None:
    now = datetime.now().astimezone().strftime("%H:%M:%S %Z")
    line = (
        status_line(item.status)
        if isinstance(item, WatchedStatus)
        else f"{item.error.kind}: {item.error.what}"
    )
    print(f"{now}  {line}", file=session.out.file, flush=True)


def _print_json(session: Session, item: WatchedStatus | Outage) -> None:
    document = {
        "at": datetime.now(UTC).isoformat(timespec="milliseconds"),
        "status": json_form(item.status) if isinstance(item, WatchedStatus) else None,
        "error": error_as_json(item.error) if isinstance(item, Outage) else None,
    }
    print_json(session.out, document, on_one_line=True)
