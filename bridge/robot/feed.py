"""What the gateway's event stream brings: events, and gaps for all that is missing, in their order.

Pure. The gateway announces most gaps; a jump of the sequence without one is a gap all the same, and an event
that was taken already is left out.
"""

import re
from typing import Final

from bridge.events.values import DropReason, Event, Gap, Item, Position
from omniseer.gateway.v1 import event_pb2, robot_gateway_pb2

MOST_EVENT_BYTES: Final = 64 * 1024
"""A larger event is reduced to its numbers and the beginning of its message."""
_MESSAGE_CHARACTERS: Final = 1000
_COMPONENT_CHARACTERS: Final = 100
_RUN_ID: Final = re.compile(r"[A-Za-z0-9_-]{1,64}")
"""One token of a subject."""
_LARGEST: Final = 2**63 - 1
"""What SQLite holds; a run of a gateway has far fewer events."""


class FeedError(Exception):
    """The gateway sends what can't be right."""


class Feed:
    """Turns responses of SubscribeEvents into items.

    Args:
        position: after the last event that the outbox has; None if it is new, and begins after all that the
            gateway
            has kept.
        probes: for the first gap of a new outbox.
    """

    def __init__(self, position: Position | None, probes: int = 0) -> None:
        self.position = position
        self._probes = probes

    def take(self, response: robot_gateway_pb2.SubscribeEventsResponse, reason: DropReason) -> list[Item]:
        """Returns the items that a response brings, and moves the position behind them.

        Args:
            response: the next one of the stream.
            reason: why events are missing, if some are.

        Raises:
            FeedError: it names an impossible run or sequence.
        """
        match response.WhichOneof("item"):
            case "event":
                return self._take_event(response.event, reason)
            case "gap":
                return self._up_to(response.gap.position, reason)
            case "caught_up" if self.position is None:
                return self._begin_after(response.caught_up)
            case "caught_up":
                return self._up_to(response.caught_up, reason)
            case _:
                return []  # Of a newer gateway.

    def _begin_after(self, here: event_pb2.EventPosition) -> list[Item]:
        """Returns the gap of a new outbox: all that the run has had."""
        self.position = Position(_run(here.run_id), _sequence(here.sequence))
        reason = DropReason.OUTBOX_LOST
        return [Gap(here.run_id, 1, here.sequence, reason, earlier=True, probes=self._probes)]

    def _take_event(self, event: event_pb2.Event, reason: DropReason) -> list[Item]:
        before = event_pb2.EventPosition(run_id=event.run_id, sequence=max(event.sequence, 1) - 1)
        items = self._up_to(before, reason)
        here = self.position
        # In a new outbox all is left out that was before it: CaughtUp ends that.
        if here is None or event.sequence <= here.sequence:
            return items
        self.position = Position(event.run_id, event.sequence)
        return [*items, _event(event)]

    def _up_to(self, place: event_pb2.EventPosition, reason: DropReason) -> list[Item]:
        """Returns the gap between the position and a place, if there is one."""
        here, run_id, sequence = self.position, _run(place.run_id), _sequence(place.sequence)
        if here is None:
            return []
        if here.run_id == run_id:
            if sequence <= here.sequence:
                return []
            self.position = Position(run_id, sequence)
            return [Gap(run_id, here.sequence + 1, sequence, reason)]
        # Whether the earlier run had more to say can't be known.
        self.position = Position(run_id, sequence)
        return [Gap(run_id, 1, sequence, reason, earlier=True)]


def _run(run_id: str) -> str:
    if not _RUN_ID.fullmatch(run_id):
        raise FeedError(f"the gateway names its run {run_id[:64]!r}, which can't be part of a subject")
    return run_id


def _sequence(sequence: int) -> int:
    if sequence >= _LARGEST:
        raise FeedError(f"the gateway numbers an event {sequence}, which can't be")
    return sequence


def _event(event: event_pb2.Event) -> Event:
    payload = event.SerializeToString(deterministic=True)
    if len(payload) > MOST_EVENT_BYTES:
        reduced = event_pb2.Event(
            run_id=event.run_id,
            sequence=event.sequence,
            monotonic_ns=event.monotonic_ns,
            wall_clock_unix_ms=event.wall_clock_unix_ms,
            severity=event.severity,
            component=event.component[:_COMPONENT_CHARACTERS],
            message=f"{event.message[:_MESSAGE_CHARACTERS]} ... (shortened: it had {len(payload)} bytes)",
        )
        payload = reduced.SerializeToString(deterministic=True)
    return Event(event.run_id, event.sequence, event.severity, payload)
