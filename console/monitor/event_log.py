"""What is new among the events that each snapshot lists: for gateways that can't stream them."""

import time
from collections.abc import Callable

from console.client import OverlaySnapshot
from console.client.results import OperatorEvent
from console.monitor.event_lines import EventLine

_MS_PER_S = 1000


class EventLog:
    """Tells each event once; says when events were missed, and when another gateway speaks.

    Args:
        clock: this computer's calendar clock.
    """

    def __init__(self, clock: Callable[[], float] = time.time) -> None:
        self._clock = clock
        self._last = 0
        self._speaker: tuple[str | None, int] | None = None

    def news(self, snapshot: OverlaySnapshot) -> list[EventLine]:
        """The lines that this snapshot adds, oldest first."""
        lines: list[EventLine] = []
        if self._another_gateway(snapshot):
            self._last = 0
            lines.append(self._own("The gateway was started again: its events begin anew"))
        fresh = [event for event in snapshot.events if event.sequence > self._last]
        if fresh:
            missed = fresh[0].sequence - self._last - 1
            # What happened before the window was opened was not missed.
            if self._last and missed:
                lines.append(
                    self._own("1 event was missed" if missed == 1 else f"{missed} events were missed")
                )
            lines += [self._logged(event) for event in fresh]
            self._last = fresh[-1].sequence
        return lines

    def _another_gateway(self, snapshot: OverlaySnapshot) -> bool:
        gateway = snapshot.status.gateway
        newest = snapshot.events[-1].sequence if snapshot.events else 0
        before, self._speaker = self._speaker, (gateway.boot_id, gateway.uptime_ms or 0)
        if before is None:
            return False
        boot_id, up_ms = before
        # Numbers that run backwards tell it of a gateway that does not tell its uptime.
        return boot_id != gateway.boot_id or (gateway.uptime_ms or 0) < up_ms or newest < self._last

    def _own(self, message: str) -> EventLine:
        return EventLine(self._clock(), message, own=True)

    def _logged(self, event: OperatorEvent) -> EventLine:
        return EventLine(self._clock() - event.age_ms / _MS_PER_S, event.message)
