"""Takes the gateway's events into the outbox, each once, over all failures of either.

The gateway keeps the newest 1024 events, so nothing is kept here: what could not be written is asked for
again, from the position that the disk has.
"""

import logging
from typing import Final

from bridge.config import GatewaySettings
from bridge.events.values import DropReason, Event, Item
from bridge.outbox.database import MOST_PROBES
from bridge.outbox.errors import OutboxError
from bridge.outbox.items import MOST_BYTES, MOST_ITEMS
from bridge.outbox.outbox import Outbox
from bridge.robot.feed import Feed, FeedError
from bridge.robot.gateway import EVENTS_SILENT_S, events, explained
from common.errors import UserError
from common.jittered_backoff import JitteredBackoff
from console.client.errors import DeadlineExceeded, GatewayError
from console.client.transport import Responses

_log = logging.getLogger(__name__)

_LONGEST_PAUSE_S: Final = 10.0
"""The gateway is on the same robot."""


class EventReader:
    """Reads events until cancelled.

    Args:
        settings: of the gateway.
        outbox: takes them.
    """

    def __init__(self, settings: GatewaySettings, outbox: Outbox) -> None:
        self._settings = settings
        self._outbox = outbox
        self._disk_failed = False
        self.failures = 0
        """Streams that have ended, or brought what can't be right."""

    async def run(self) -> None:
        """Reads; a failure of gateway or disk is tried again for as long as it takes."""
        backoff = JitteredBackoff(_LONGEST_PAUSE_S)
        while True:
            try:
                await self._read(backoff)
            except OutboxError:
                self._disk_failed = True
            except UserError as error:
                level = logging.INFO if isinstance(error, GatewayError) else logging.ERROR
                _log.log(level, "no events from the gateway: %s", explained(error))
                self.failures += 1
            except FeedError as error:
                _log.error("no events from the gateway: %s", error)
                self.failures += 1
            await backoff.wait()

    async def _read(self, backoff: JitteredBackoff) -> None:
        position = await self._outbox.position()
        lost = await self._outbox.lost()
        feed = Feed(position, MOST_PROBES)
        async with events(self._settings, position) as responses:
            while True:
                reason, before = self._reason(lost=lost), feed.position
                items = await _next_items(responses, feed, reason)
                backoff.reset()
                if items and feed.position:
                    await self._outbox.append(items, before, feed.position)
                    lost = False
                self._disk_failed = False

    def _reason(self, *, lost: bool) -> DropReason:
        """Returns why events are missing, if some are."""
        if lost:
            return DropReason.OUTBOX_LOST
        return DropReason.DISK if self._disk_failed else DropReason.NO_LONGER_KEPT


async def _next_items(responses: Responses, feed: Feed, reason: DropReason) -> list[Item]:
    """Waits for a response and returns its items, with those of all that have come meanwhile."""
    items = feed.take(await responses.read(EVENTS_SILENT_S), reason)
    while len(items) < MOST_ITEMS - 1 and _size(items) < MOST_BYTES / 2:
        try:
            items += feed.take(await responses.read(0), reason)
        except DeadlineExceeded:
            break
    return items


def _size(items: list[Item]) -> int:
    return sum(len(each.payload) for each in items if isinstance(each, Event))
