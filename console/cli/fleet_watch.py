"""robotctl fleet watch: the fleet's table on every change, redrawn on a terminal, line by line elsewhere."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated, Any, Final

from rich.console import Group
from rich.text import Text

from console.cli.fleet_session import FleetSession, with_fleet
from console.cli.fleet_tables import rows_table
from console.cli.live_screen import Fitted, Screen
from console.cli.loop_signals import ENDING, handled
from console.cli.options import CountOption, interval_option
from console.cli.session import print_json
from console.fleet.columns import COLUMNS, summary_line
from console.fleet.model import summary
from console.fleet.values import FleetRow
from console.presentation.json_form import json_form

if TYPE_CHECKING:
    from fleet.connection import Entry

_REDRAW_S: Final = 1.0
"""Ages count up between two states as well."""
_CLOCK_AGAIN_AFTER_S: Final = 60.0


@with_fleet
def watch(
    session: FleetSession,
    *,
    interval_s: Annotated[float, interval_option(0.25)] = 1.0,
    count: CountOption = None,
) -> None:
    """Show the fleet whenever it changes, until Ctrl-C.

    On a terminal the table is redrawn in place; a pipe or a file gets one line per robot that has changed.
    """
    asyncio.run(_Watch(session, interval_s, count).run())


class _Watch:
    """One run."""

    def __init__(self, session: FleetSession, interval_s: float, count: int | None) -> None:
        self._session = session
        self._interval_s = interval_s
        self._count = count
        self._ending = asyncio.Event()
        self._changed = asyncio.Event()
        self._shown: dict[str, FleetRow] = {}

    async def run(self) -> None:
        """Runs until it is ended."""
        # The extra `fleet` may not be installed: `with_fleet` has found out.
        from console.fleet.hub import read_board  # noqa: PLC0415
        from fleet.clock import read_clock  # noqa: PLC0415
        from fleet.names import ROBOTS, STATES  # noqa: PLC0415

        with handled(dict.fromkeys(ENDING, self._end)):
            async with self._session.connect() as self._hub, asyncio.TaskGroup() as tasks:
                self._clock = await read_clock(self._hub)
                self._board = await read_board(self._hub)
                readers = [
                    tasks.create_task(self._read(self._hub.watch_bucket(ROBOTS), self._board.take_robot)),
                    tasks.create_task(self._read(self._hub.watch_bucket(STATES), self._board.take_state)),
                    tasks.create_task(self._notice_outages()),
                    tasks.create_task(self._keep_time()),
                    tasks.create_task(self._hub.lasting()),
                ]
                await self._show()
                for reader in readers:
                    reader.cancel()

    async def _read(self, entries: AsyncIterator["Entry"], take: Callable[["Entry"], None]) -> None:
        async for entry in entries:
            take(entry)
            self._changed.set()

    async def _notice_outages(self) -> None:
        while True:
            before = self._hub.link.connected
            await self._hub.changed.wait_until(lambda: self._hub.link.connected != before)  # noqa: B023
            self._changed.set()

    async def _keep_time(self) -> None:
        """Reads the hub's clock again and again: this computer's clock drifts."""
        from fleet.clock import read_clock  # noqa: PLC0415
        from fleet.errors import HubError  # noqa: PLC0415

        while True:
            await asyncio.sleep(_CLOCK_AGAIN_AFTER_S)
            # The next one is as good; an outage is shown by itself.
            with suppress(HubError):
                self._clock = await read_clock(self._hub)

    async def _show(self) -> None:
        session = self._session
        if session.out.is_terminal and not session.as_json:
            with Screen(session.out, None, self._view) as screen:
                await self._updates(lambda: screen.draw(self._view()), at_least_every_s=_REDRAW_S)
        else:
            await self._updates(self._print_changes, at_least_every_s=None)

    async def _updates(self, update: Callable[[], bool | None], at_least_every_s: float | None) -> None:
        """Updates at once, and then on every change, no more often than the interval.

        Args:
            update: Returns False where there was nothing to show.
            at_least_every_s: Updates after this time without a change as well.
        """
        updates = 0
        while not self._ending.is_set():
            self._changed.clear()
            updates += update() is not False
            if updates == self._count:
                return
            if await self._ends_within(self._interval_s):
                return
            with suppress(TimeoutError):
                async with asyncio.timeout(at_least_every_s):
                    await self._changed.wait()

    async def _ends_within(self, pause_s: float) -> bool:
        with suppress(TimeoutError):
            async with asyncio.timeout(pause_s):
                await self._ending.wait()
        return self._ending.is_set()

    def _end(self) -> None:
        self._ending.set()
        self._changed.set()

    def _rows(self) -> tuple[FleetRow, ...]:
        return self._board.rows(self._clock.unix_ms())

    def _view(self) -> Fitted:
        rows = self._rows()
        head = Text(summary_line(summary(rows)), style="bold")
        outage = Text(f"{self._outage()}; ages count on", style="bold red") if self._outage() else Text()
        body = rows_table(rows, self._session.out.width)
        return Fitted(Group(head, outage), body, Text("Ctrl-C ends", style="dim"))

    def _outage(self) -> str:
        link = self._hub.link
        return "" if link.connected else f"THE HUB DOES NOT ANSWER: {link.text}"

    def _print_changes(self) -> bool:
        rows, changed = self._rows(), False
        if self._session.as_json:
            changed = {row.robot: without_ages(row) for row in rows} != self._shown
            if changed:
                print_json(self._session.out, fleet_json(rows), on_one_line=True)
        for row in rows:
            if not self._session.as_json and self._shown.get(row.robot) != without_ages(row):
                changed = True
                self._print_line(row)
        self._shown = {row.robot: without_ages(row) for row in rows}
        return changed

    def _print_line(self, row: FleetRow) -> None:
        now = datetime.now().astimezone().strftime("%H:%M:%S %Z")
        cells = (column.cell(row).text for column in COLUMNS if column.title not in ("since", "seen"))
        print(f"{now}  {'  '.join(cells)}", file=self._session.out.file, flush=True)


def without_ages(row: FleetRow) -> FleetRow:
    """Returns a row without what alone is no change: ages and counters of reports."""
    state = row.state and replace(row.state, sequence=0, wall_clock_unix_ms=0, gateway_uptime_s=0)
    return replace(row, since_ms=None, last_seen_ms=None, state=state)


def fleet_json(rows: tuple[FleetRow, ...]) -> dict[str, Any]:
    """Returns the JSON form of the fleet."""
    return {
        "at": datetime.now(UTC).isoformat(timespec="milliseconds"),
        "robots": json_form(rows),
        "summary": json_form(summary(rows)),
    }
