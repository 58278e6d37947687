"""Who stays: connections with a stream open for a while, told when they come and when they go.

Somebody who looks once, or reconnects again and again, is no news.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

from gateway.status.event import ClientJoined, ClientLeft, News
from gateway.status.fault import Severity

STAYS_AFTER_S: Final = 2.0
"""A stream that has been open for this long belongs to somebody who stays."""
_COMPONENT: Final = "gateway"


@dataclass(slots=True)
class _Client:
    since_s: float
    streams: int = 0
    told: bool = False


class Staying:
    """Belongs to one event loop.

    Args:
        note: takes the news.
        clock: seconds, monotonic.
    """

    def __init__(self, note: Callable[[News], None], clock: Callable[[], float] = time.monotonic) -> None:
        self._note = note
        self._clock = clock
        self._clients: dict[str, _Client] = {}

    @contextmanager
    def stream(self, address: str) -> Iterator[None]:
        """This address has a stream open while the block lasts."""
        client = self._clients.setdefault(address, _Client(self._clock()))
        client.streams += 1
        try:
            yield
        finally:
            client.streams -= 1
            if client.streams == 0:
                del self._clients[address]
                if client.told:
                    words = f"{address} left"
                    self._note(News(Severity.INFO, _COMPONENT, words, ClientLeft(address)))

    def look(self) -> None:
        """Tells of those who have stayed long enough by now. To be called a few times a second."""
        before_s = self._clock() - STAYS_AFTER_S
        for address, client in self._clients.items():
            if not client.told and client.since_s <= before_s:
                client.told = True
                words = f"{address} joined"
                self._note(News(Severity.INFO, _COMPONENT, words, ClientJoined(address)))
