"""robotctl watch: the status again and again, redrawn on a terminal, line by line elsewhere."""

from datetime import UTC, datetime
from typing import Any

from console.cli.json_form import json_form
from console.cli.live.program import watch_on_a_terminal
from console.cli.look import Look, looks
from console.cli.session import Session, error_as_json
from console.cli.stopping import until_stopped
from console.presentation.status_line import status_line


def watch_until_stopped(session: Session, interval_s: float, count: int | None) -> None:
    """Shows each status that the robot tells, until SIGINT or SIGTERM, or `count` times.

    Args:
        session: where from, where to.
        interval_s: the least time between two of them.
        count: None for no end.

    Raises:
        GatewayError: the very first look failed. Later the robot may come and go: that is shown.
    """
    if session.out.is_terminal and not session.as_json:
        watch_on_a_terminal(session, interval_s, count)
        return
    screen = _JsonLines(session) if session.as_json else _Lines(session)
    with session.connect() as robot, until_stopped(robot.close) as stopped:
        told = stopped.as_end_of(robot.watch_status(interval_s))
        for number, look in enumerate(looks(told), start=1):
            screen.show(look)
            if number == count:
                return


class _Lines:
    """One line of text per look."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def show(self, look: Look) -> None:
        now = datetime.now().astimezone().strftime("%H:%M:%S")
        said = f"{look.trouble.kind}: {look.trouble.what}" if look.trouble else status_line(look.status)
        print(f"{now}  {said}", file=self._session.out.file, flush=True)


class _JsonLines:
    """One JSON document per line and look; no status where the look brought none."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def show(self, look: Look) -> None:
        document: dict[str, Any] = {
            "at": datetime.now(UTC).isoformat(timespec="milliseconds"),
            "status": None if look.trouble else json_form(look.status),
            "error": error_as_json(look.trouble) if look.trouble else None,
        }
        self._session.print_json(document, on_one_line=True)
