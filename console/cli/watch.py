"""robotctl watch: the status again and again, redrawn on a terminal, line by line elsewhere."""

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from types import FrameType
from typing import Any

from console.cli.json_form import json_form
from console.cli.live.program import watch_on_a_terminal
from console.cli.look import Look
from console.cli.session import Session, error_as_json
from console.cli.watch_line import watch_line
from console.client import DeadlineExceeded, GatewayClient, GatewayError, Unreachable

_MS_PER_S = 1000


def watch_until_stopped(session: Session, interval_s: float, count: int | None) -> None:
    """Looks every `interval_s` until SIGINT or SIGTERM, or `count` times.

    Raises:
        GatewayError: the very first look failed. Later the robot may come and go: that is shown.
    """
    if session.out.is_terminal and not session.as_json:
        watch_on_a_terminal(session, interval_s, count)
        return
    stop = threading.Event()
    screen = _JsonLines(session) if session.as_json else _Lines(session)
    with _signals_set(stop), session.connect() as robot:
        for number, look in enumerate(_looks(robot, interval_s, stop), start=1):
            screen.show(look)
            if number == count:
                return


def _looks(robot: GatewayClient, interval_s: float, stop: threading.Event) -> Iterator[Look]:
    newest = robot.status()
    received_s = due_s = time.monotonic()
    yield Look(newest, None, 0)
    while True:
        # After a slow answer the beat starts anew: looks are never made up for.
        due_s = max(due_s + interval_s, time.monotonic())
        if stop.wait(due_s - time.monotonic()):
            return
        trouble: GatewayError | None = None
        try:
            newest = robot.status()
            received_s = time.monotonic()
        except (Unreachable, DeadlineExceeded) as error:
            trouble = error
        yield Look(newest, trouble, round((time.monotonic() - received_s) * _MS_PER_S))


@contextmanager
def _signals_set(stop: threading.Event) -> Iterator[None]:
    def on_signal(_number: int, _frame: FrameType | None) -> None:
        stop.set()

    before = {number: signal.signal(number, on_signal) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class _Lines:
    """One line of text per look."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def show(self, look: Look) -> None:
        now = datetime.now().astimezone().strftime("%H:%M:%S")
        said = f"{look.trouble.kind}: {look.trouble.what}" if look.trouble else watch_line(look.status)
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
