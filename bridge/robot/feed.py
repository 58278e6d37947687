"""What the gateway's event stream brings, in the order of the outbox: events, and gaps for all that is missing.

Pure. The gateway announces most gaps; a jump of the sequence without one is a gap all the same, and an event that
was taken already is left out.
"""

import re
from typing import Final

from bridge.values import DropReason, Event, Gap, Item, Position
from omniseer.gateway.v1 import event_pb2, robot_gateway_pb2

MOST_EVENT_BYTES: Final = 64 * 1024
"""A larger event is reduced to its numbers and the beginning of its message."""
_MESSAGE_CHARACTERS: Final = 1000
_COMPONENT_CHARACTERS: Final = 100
_RUN_ID: Final = re.compile(r"[A-Za-z0-9_-]{1,64}")
"""One token of a subject."""


class FeedError(Exception):
    """The gateway sends what can't be right."""


class Feed:
    """Turns responses of SubscribeEvents into items.

    Args:
        position: after the last event that the outbox has; None if it is new, and begins after all that the gateway
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
            FeedError: it names an impossible run.
        """
        match response.WhichOneof("item"):
            case "event":
                place = response.event
                if self.position is None:
                    return []  # It happened before this outbox; CaughtUp ends such events.
                items = self._up_to(_run(place.run_id), place.sequence - 1, reason)
                if place.run_id == self.position.run_id and place.sequence <= self.position.sequence:
                    return []
                self.position = Position(place.run_id, place.sequence)
                return [*items, _event(place)]
            case "gap":
                if self.position is None:
                    return []
                here = response.gap.position
                return self._up_to(_run(here.run_id), here.sequence, reason)
            case "caught_up":
                here = response.caught_up
                if self.position is None:
                    self.position = Position(_run(here.run_id), here.sequence)
                    lost = DropReason.OUTBOX_LOST
                    return [Gap(here.run_id, 1, here.sequence, lost, earlier=True, probes=self._probes)]
                return self._up_to(_run(here.run_id), here.sequence, reason)
            case _:
                return []  # Of a newer gateway.

    def _up_to(self, run_id: str, sequence: int, reason: DropReason) -> list[Item]:
        """Returns the gap between the position and the place after an event, if there is one."""
        here = self.position
        if here is not None and here.run_id == run_id:
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
