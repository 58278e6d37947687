"""Events, told to everybody who subscribed: serialised once; every subscriber reads the same ring."""

import asyncio
from collections.abc import AsyncIterator
from functools import partial
from typing import Final

from common.broadcast import Broadcast
from gateway.rpc.mapping.events import event_message, gap_message, position_message
from gateway.status.event import Event
from gateway.status.events import EventLog, Gap, Position
from gateway.status.fault import Severity
from omniseer.gateway.v1.robot_gateway_pb2 import SubscribeEventsResponse

SIGN_OF_LIFE_S: Final = 5.0
"""How long a stream may say nothing."""
_AT_ONCE: Final = 64
"""Events read from the ring in one go."""
_MOST_READY: Final = 256
"""Serialised events that are remembered for the next subscriber."""


class EventStreams:
    """Belongs to one event loop.

    Args:
        log: what happened; this object becomes its listener.
    """

    def __init__(self, log: EventLog) -> None:
        self._log = log
        self._appended = Broadcast()
        self._ready: dict[int, bytes] = {}
        """Serialised events by their sequence."""
        self.gaps = 0
        """How often a subscriber was told that events are missing."""
        log.on_event = self._appended.wake_all

    async def events(self, after: Position | None, least: Severity) -> AsyncIterator[bytes]:
        """Serialised answers, until the caller leaves.

        Args:
            after: where the subscriber stands; None for one that takes what is kept.
            least: what matters less is left out.

        Raises:
            InvalidRequestError: a place that this run has not come to.
        """
        loop = asyncio.get_running_loop()
        # A subscriber is told that it has everything when it has; later only when nothing else is told.
        told_s = loop.time() - SIGN_OF_LIFE_S
        while True:
            reading = self._log.read(after, _AT_ONCE)
            after = here = reading.position
            if reading.gap:
                self.gaps += 1
                yield _gap(reading.gap)
            for event in reading.events:
                if event.news.severity.rank >= least.rank:
                    yield self._event(event)
            if reading.events:
                continue
            if loop.time() - told_s >= SIGN_OF_LIFE_S:
                told_s = loop.time()
                yield _caught_up(here)
            await self._appended.wait_until(
                partial(self._goes_on_after, here),
                max(0.0, told_s + SIGN_OF_LIFE_S - loop.time()),
            )

    def _goes_on_after(self, here: Position) -> bool:
        return self._log.sequence > here.sequence

    def _event(self, event: Event) -> bytes:
        ready = self._ready.get(event.sequence)
        if ready is None:
            message = event_message(event, self._log.run_id)
            ready = self._ready[event.sequence] = SubscribeEventsResponse(event=message).SerializeToString()
            if len(self._ready) > _MOST_READY:
                del self._ready[next(iter(self._ready))]
        return ready


def _gap(gap: Gap) -> bytes:
    return SubscribeEventsResponse(gap=gap_message(gap)).SerializeToString()


def _caught_up(position: Position) -> bytes:
    return SubscribeEventsResponse(caught_up=position_message(position)).SerializeToString()
