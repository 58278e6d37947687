"""The position of an event subscriber, kept across connections: no event lost, none delivered twice."""

from collections.abc import Iterator

from console.client.mapping.methods import events_request
from console.client.results import CaughtUp, Event, EventGap, EventPosition, FaultSeverity, GapReason


class EventFeed:
    """Tracks the position to resume from.

    Args:
        after: Where to begin; None begins with the oldest event that the gateway keeps.
        least: Events of lower severity are left out.
    """

    def __init__(
        self, after: EventPosition | None = None, least: FaultSeverity = FaultSeverity.UNKNOWN
    ) -> None:
        self.position = after
        self._least = least

    def request(self) -> bytes:
        """Returns the request that resumes at the present position."""
        return events_request(self.position, self._least)

    def take(self, item: Event | EventGap | CaughtUp | None) -> Iterator[Event | EventGap | CaughtUp]:
        """Yields the item unless it is a duplicate, preceded by a gap where events are missing before it."""
        if item is None or self._is_duplicate(item):
            return
        gap = self._unannounced(item)
        if gap:
            yield gap
        self.position = item.position
        yield item

    def _is_duplicate(self, item: Event | EventGap | CaughtUp) -> bool:
        here = self.position
        return (
            isinstance(item, Event)
            and here is not None
            and item.position.run_id == here.run_id
            and item.position.sequence <= here.sequence
        )

    def _unannounced(self, item: Event | EventGap | CaughtUp) -> EventGap | None:
        """Returns a gap that the gateway did not announce. A filtered feed can't detect one within a run."""
        here = self.position
        if not isinstance(item, Event) or here is None:
            return None
        run_id, before = item.position.run_id, item.position.sequence - 1
        if run_id != here.run_id:
            reason, missed = GapReason.NEW_RUN, before
        elif self._least is FaultSeverity.UNKNOWN and before > here.sequence:
            reason, missed = GapReason.UNKNOWN, before - here.sequence
        else:
            return None
        return EventGap(reason=reason, missed_count=missed, position=EventPosition(run_id, before))
