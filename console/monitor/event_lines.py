"""Events as lines of a log: when, how much they matter, what happened."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from console.client import CaughtUp, Event, EventGap, FaultSeverity, Outage
from console.client.results import EventKind, GapReason
from console.tone import Tone
from console.words import plural

KEPT: Final = 200
"""Older lines go."""
_MS_PER_S: Final = 1000
_TONES: Final = {FaultSeverity.WARNING: Tone.WARNING, FaultSeverity.ERROR: Tone.BAD}


@dataclass(frozen=True, slots=True)
class EventLine:
    """One line.

    Args:
        at_s: when it happened: the robot's calendar clock, or this computer's where the robot tells none; in
            seconds since 1970.
        text: what happened.
        tone: how much it matters.
        own: whether the monitor says so, not the robot.
    """

    at_s: float
    text: str
    tone: Tone = Tone.QUIET
    own: bool = False


@dataclass(frozen=True, slots=True)
class EventTrail:
    """The newest lines, and how many there ever were: whoever shows them knows which it has not shown yet.

    Args:
        lines: at most KEPT of them, oldest first.
        count: of all lines that were ever added.
    """

    lines: tuple[EventLine, ...] = ()
    count: int = 0

    def with_lines(self, more: Iterable[EventLine]) -> "EventTrail":
        """The trail with further lines at its end."""
        added = tuple(more)
        return EventTrail((*self.lines, *added)[-KEPT:], self.count + len(added))

    def since(self, count: int) -> tuple[EventLine, ...]:
        """What was added after there were `count`; no more than is kept."""
        fresh = min(self.count - count, len(self.lines))
        return self.lines[len(self.lines) - fresh :]


def line_of(item: Event | EventGap | CaughtUp | Outage, now_s: float) -> EventLine | None:
    """The line of something that was streamed; None where there is nothing to say.

    Args:
        item: as the client's `events` gives it.
        now_s: this computer's calendar clock.
    """
    match item:
        case Event():
            tone = _TONES.get(item.severity, Tone.QUIET)
            return EventLine(item.wall_clock_unix_ms / _MS_PER_S, _words(item), tone)
        case EventGap():
            return EventLine(now_s, _missing(item), Tone.WARNING, own=True)
        case CaughtUp() | Outage():
            # What the connection does is said elsewhere.
            return None


def _words(event: Event) -> str:
    if event.control:
        who = event.control.who or event.control.address
        return f"{who} asked for {event.control.method}: {event.control.result.value}, {event.control.answer}"
    over = event.kind is EventKind.FAULT_CLEARED
    severity = "over" if over else event.severity.value if event.severity in _TONES else ""
    # A message may say by itself what stands before it.
    before = [word for word in (severity, event.component) if word and word not in event.message]
    return ": ".join([*before, event.message])


def _missing(gap: EventGap) -> str:
    if gap.reason is GapReason.NEW_RUN:
        return "The gateway was started again: its events begin anew"
    return f"{plural(gap.missed_count, 'event')} missed: more came than the gateway keeps"
