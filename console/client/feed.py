"""Events without loss, without doubles: where a subscriber stands, whatever becomes of its connections."""

from collections.abc import Iterator

from console.client.mapping.methods import EventsWanted
from console.client.results import CaughtUp, Event, EventGap, EventPosition, FaultSeverity, GapReason


class EventFeed:
    """Knows the place to go on from after each thing that was received.

    Args:
        after: where to begin; None takes what the gateway still keeps.
        least: what matters less is left out.
    """

    def __init__(
        self, after: EventPosition | None = None, least: FaultSeverity = FaultSeverity.UNKNOWN
    ) -> None:
        self.position = after
        self._least = least

    def wanted(self) -> EventsWanted:
        """What to ask the gateway for now."""
        return EventsWanted(self.position, self._least)

    def take(self, item: Event | EventGap | CaughtUp | None) -> Iterator[Event | EventGap | CaughtUp]:
        """What of the item is news to the subscriber: itself, nothing, or a gap before it."""
        if item is None or self._is_old(item):
            return
        gap = self._unannounced(item)
        if gap:
            yield gap
        self.position = item.position
        yield item

    def _is_old(self, item: Event | EventGap | CaughtUp) -> bool:
        """Whether it was received before; a gateway that keeps its word sends nothing twice."""
        here = self.position
        return (
            isinstance(item, Event)
            and here is not None
            and item.position.run_id == here.run_id
            and item.position.sequence <= here.sequence
        )

    def _unannounced(self, item: Event | EventGap | CaughtUp) -> EventGap | None:
        """A gap that the gateway did not tell. Who leaves events out can't see any within a run."""
        here = self.position
        if not isinstance(item, Event) or here is None:
            return None
        run_id, before = item.position.run_id, item.position.sequence - 1
        if run_id != here.run_id:
            return EventGap(
                reason=GapReason.NEW_RUN, missed_count=before, position=EventPosition(run_id, before)
            )
        if self._least is FaultSeverity.UNKNOWN and before > here.sequence:
            return EventGap(
                reason=GapReason.UNKNOWN,
                missed_count=before - here.sequence,
                position=EventPosition(run_id, before),
            )
        return None
