"""Events for all subscribers: each is serialised once, and every subscriber reads the same ring."""

import asyncio
from collections.abc import AsyncIterator
from functools import partial
from typing import Final

from common.broadcast import Broadcast
from gateway.rpc.mapping.events import event_message, gap_message, position_message
from gateway.status.event import LoggedEvent
from gateway.status.event_log import EventLog, Position
from gateway.status.fault import Severity
from omniseer.gateway.v1.robot_gateway_pb2 import SubscribeEventsResponse

HEARTBEAT_S: Final = 5.0
"""The longest silence of a stream."""
_MAX_READ: Final = 64
"""Events read from the ring at once."""
_MAX_CACHED: Final = 256
"""Serialised events that are kept for the next subscriber."""


class EventStream:
    """Serves SubscribeEvents on one event loop.

    Args:
        log: the ring of events.
        appended: notified after each event.
    """

    def __init__(self, log: EventLog, appended: Broadcast) -> None:
        self._log = log
        self._appended = appended
        self._serialised: dict[int, bytes] = {}
        """By sequence."""
        self.gaps = 0
        """How often a subscriber missed events."""

    async def responses(self, after: Position | None, least: Severity) -> AsyncIterator[bytes]:
        """Yields serialised responses until the caller leaves.

        Args:
            after: the subscriber's position; None for one that takes all that is kept.
            least: events of lower severity are left out.

        Raises:
            InvalidRequestError: a position that this run has not reached.
        """
        loop = asyncio.get_running_loop()
        # The position is sent when the subscriber has caught up, and then as a heartbeat.
        position_sent_s = loop.time() - HEARTBEAT_S
        while True:
            reading = self._log.read(after, _MAX_READ)
            after = here = reading.position
            if reading.gap:
                self.gaps += 1
                yield SubscribeEventsResponse(gap=gap_message(reading.gap)).SerializeToString()
            for logged in reading.events:
                if logged.event.severity.rank >= least.rank:
                    yield self._event(logged)
            if reading.events:
                continue
            if loop.time() - position_sent_s >= HEARTBEAT_S:
                position_sent_s = loop.time()
                yield SubscribeEventsResponse(caught_up=position_message(here)).SerializeToString()
            await self._appended.wait_until(
                partial(self._has_events_after, here),
                max(0.0, position_sent_s + HEARTBEAT_S - loop.time()),
            )

    def _has_events_after(self, here: Position) -> bool:
        return self._log.sequence > here.sequence

    def _event(self, logged: LoggedEvent) -> bytes:
        serialised = self._serialised.get(logged.sequence)
        if serialised is None:
            message = event_message(logged, self._log.run_id)
            serialised = SubscribeEventsResponse(event=message).SerializeToString()
            self._serialised[logged.sequence] = serialised
            if len(self._serialised) > _MAX_CACHED:
                del self._serialised[next(iter(self._serialised))]
        return serialised
