"""The gateway's events: logged, kept in a ring, and announced to the streams that serve them."""

import logging
import secrets
import time
from typing import Final

from common.broadcast import Broadcast
from gateway.status.event import Event
from gateway.status.event_log import EventLog

_log = logging.getLogger(__name__)

_RUN_ID_BYTES: Final = 8


class Events:
    """Where every part of the gateway puts what happened. Used on one event loop.

    Attributes:
        log: the newest events of this run.
        added: notified after each event.
    """

    def __init__(self) -> None:
        self.log = EventLog(secrets.token_hex(_RUN_ID_BYTES))
        self.added = Broadcast()

    def note(self, event: Event) -> None:
        """Adds an event of this instant."""
        _log.info("event: %s", event.sentence or event.message)
        self.log.add(event, time.monotonic())
        self.added.notify_all()
