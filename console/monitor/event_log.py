"""Log of the robot's events: a bounded list of lines."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from console.client import CaughtUp, Event, EventGap, FaultSeverity, Outage
from console.client.results import EventKind, GapReason
from console.presentation.formatting import plural
from console.presentation.severity_style import SeverityStyle

CAPACITY: Final = 1500
"""Lines that are kept, as many as a gateway keeps events; older ones are dropped."""
_MS_PER_S: Final = 1000
_STYLES: Final = {FaultSeverity.WARNING: SeverityStyle.WARNING, FaultSeverity.ERROR: SeverityStyle.BAD}


@dataclass(frozen=True, slots=True)
class EventLine:
    """One line of the log.

    Args:
        at_s: when it happened, in seconds since 1970: by the robot's calendar clock, or by this computer's if
            the robot gives no time.
        text: what happened.
        style: its severity.
        own: whether the monitor reports it, not the robot.
        presence: whether it says who joins or leaves.
    """

    at_s: float
    text: str
    style: SeverityStyle = SeverityStyle.QUIET
    own: bool = False
    presence: bool = False


@dataclass(frozen=True, slots=True)
class EventLog:
    """The newest lines, and how many there ever were, so that a view can add the lines that it lacks.

    Args:
        lines: at most CAPACITY of them, oldest first.
        count: of all lines that were ever added.
    """

    lines: tuple[EventLine, ...] = ()
    count: int = 0

    def with_lines(self, more: Iterable[EventLine]) -> "EventLog":
        """Returns the log with further lines at its end."""
        added = tuple(more)
        return EventLog((*self.lines, *added)[-CAPACITY:], self.count + len(added))

    def since(self, count: int) -> tuple[EventLine, ...]:
        """Returns the lines added after there were `count`, as far as they are kept."""
        fresh = min(self.count - count, len(self.lines))
        return self.lines[len(self.lines) - fresh :]


def line_of(item: Event | EventGap | CaughtUp | Outage, now_s: float) -> EventLine | None:
    """Returns the line of a streamed item; None for one that is not logged.

    Args:
        item: as the client's `events` yields it.
        now_s: this computer's calendar clock.
    """
    match item:
        case Event():
            style = _STYLES.get(item.severity, SeverityStyle.QUIET)
            at_s = item.wall_clock_unix_ms / _MS_PER_S
            return EventLine(at_s, _text(item), style, presence=item.is_presence)
        case EventGap():
            text = "The gateway was restarted: its events begin anew"
            if item.reason is not GapReason.NEW_RUN:
                text = f"{plural(item.missed_count, 'event')} missed: more came than the gateway keeps"
            return EventLine(now_s, text, SeverityStyle.WARNING, own=True)
        case CaughtUp() | Outage():
            # The window's header shows the state of the connection.
            return None


def _text(event: Event) -> str:
    if event.control:
        who = event.control.who or event.control.address
        return f"{who} asked for {event.control.method}: {event.control.result.value}, {event.control.answer}"
    cleared = event.kind is EventKind.FAULT_CLEARED
    severity = "cleared" if cleared else event.severity.value if event.severity in _STYLES else ""
    # The message may contain its own prefix.
    prefix = [word for word in (severity, event.component) if word and word not in event.message]
    return ": ".join([*prefix, event.message])
