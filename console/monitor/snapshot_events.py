"""Finds the new events among those that each snapshot lists: for gateways that can't stream events."""

import time
from collections.abc import Callable

from console.client import OverlaySnapshot
from console.monitor.event_log import EventLine
from console.presentation.formatting import plural

_MS_PER_S = 1000


class SnapshotEvents:
    """Logs each event once, and reports missed events and a restart of the gateway.

    Args:
        clock: this computer's calendar clock.
    """

    def __init__(self, clock: Callable[[], float] = time.time) -> None:
        self._clock = clock
        self._last = 0
        self._run: tuple[str | None, int] | None = None

    def new_lines(self, snapshot: OverlaySnapshot) -> list[EventLine]:
        """Returns the lines that this snapshot adds, oldest first."""
        lines: list[EventLine] = []
        if self._restarted(snapshot):
            self._last = 0
            lines.append(self._own("The gateway was restarted: its events begin anew"))
        fresh = [event for event in snapshot.events if event.sequence > self._last]
        if fresh:
            missed = fresh[0].sequence - self._last - 1
            # Events before the window was opened were not missed.
            if self._last and missed:
                lines.append(
                    self._own(f"{plural(missed, 'event')} {'was' if missed == 1 else 'were'} missed")
                )
            lines += [EventLine(self._clock() - each.age_ms / _MS_PER_S, each.message) for each in fresh]
            self._last = fresh[-1].sequence
        return lines

    def _restarted(self, snapshot: OverlaySnapshot) -> bool:
        gateway = snapshot.status.gateway
        newest = snapshot.events[-1].sequence if snapshot.events else 0
        before, self._run = self._run, (gateway.boot_id, gateway.uptime_ms or 0)
        if before is None:
            return False
        boot_id, uptime_ms = before
        # A gateway that does not report its uptime is recognized by numbers that run backwards.
        return boot_id != gateway.boot_id or (gateway.uptime_ms or 0) < uptime_ms or newest < self._last

    def _own(self, message: str) -> EventLine:
        return EventLine(self._clock(), message, own=True)
