"""robotctl watch: the status on every change, redrawn on a terminal, line by line elsewhere."""

from datetime import UTC, datetime

from console.cli.json_form import json_form
from console.cli.live_watch import watch_on_a_terminal
from console.cli.session import Session, error_as_json
from console.cli.stopping import until_stopped
from console.client import Outage, WatchedStatus
from console.presentation.status_line import status_line


def watch_until_stopped(session: Session, interval_s: float, count: int | None) -> None:
    """Shows each status, until SIGINT or SIGTERM, or for `count` updates.

    Args:
        session: The robot and the output.
        interval_s: Least time between two updates.
        count: None for no end.

    Raises:
        GatewayError: No status came at all. A later outage is shown instead.
    """
    if session.out.is_terminal and not session.as_json:
        watch_on_a_terminal(session, interval_s, count)
        return
    with session.connect() as robot, until_stopped(robot.close) as stopped:
        items = stopped.as_end_of(robot.watch_status(interval_s))
        for number, item in enumerate(items, start=1):
            if session.as_json:
                _print_json(session, item)
            else:
                _print_line(session, item)
            if number == count:
                return


def _print_line(session: Session, item: WatchedStatus | Outage) -> None:
    now = datetime.now().astimezone().strftime("%H:%M:%S")
    print(f"{now}  {_line(item)}", file=session.out.file, flush=True)


def _line(item: WatchedStatus | Outage) -> str:
    if isinstance(item, Outage):
        return f"{item.error.kind}: {item.error.what}"
    return status_line(item.status)


def _print_json(session: Session, item: WatchedStatus | Outage) -> None:
    document = {
        "at": datetime.now(UTC).isoformat(timespec="milliseconds"),
        "status": json_form(item.status) if isinstance(item, WatchedStatus) else None,
        "error": error_as_json(item.error) if isinstance(item, Outage) else None,
    }
    session.print_json(document, on_one_line=True)
