"""What is said in a stream that goes on over any number of connections, without the talking.

As an exchange (see exchange.py) it is a generator of steps: open a connection, read from it, pause, and tell
the caller something. The blocking and the asyncio client carry them out.
"""

import time
from collections.abc import Callable, Generator, Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final, Generic, TypeAlias, TypeVar

from console.client.errors import DeadlineExceeded, GatewayError, Overloaded, Unreachable, Unsupported
from console.client.exchange import Pause, Send
from console.client.feed import EventFeed
from console.client.mapping.methods import (
    GET_SYSTEM_STATUS,
    SUBSCRIBE_EVENTS,
    WATCH_SYSTEM_STATUS,
    Method,
)
from console.client.options import ClientOptions
from console.client.results import CaughtUp, Event, EventGap, WatchedStatus

ItemT = TypeVar("ItemT")

_LONGEST_INTERVAL_S: Final = 60.0
"""No gateway lets itself be watched more slowly; who wants that has to ask."""
_SHORTEST_PAUSE_S: Final = 0.05
"""Between two questions to a gateway that can't be watched."""
_EVENTS_SILENT_S: Final = 5.0
"""The gateway gives a sign of life this often when nothing happens."""
_STATUS_SILENT_S: Final = 1.0
"""The gateway tells the status this often when nothing changes, or once in the asked interval."""


@dataclass(frozen=True, slots=True)
class Outage:
    """The connection was lost, or another attempt to make one failed. The stream goes on by itself.

    Attributes:
        error: why.
        attempt: 1 for the loss itself, then one more for each attempt that failed.
    """

    error: GatewayError
    attempt: int


@dataclass(frozen=True, slots=True)
class Open:
    """Step: call this method, ending the call before, if any. Nothing comes of it yet.

    Attributes:
        newest_only: whether an answer may be left out when a newer one is there.
    """

    method: Method[Any, Any]
    request: Any
    newest_only: bool


@dataclass(frozen=True, slots=True)
class Read:
    """Step: give back the next answer, or the `GatewayError` that the call ended with.

    When none comes within `within_s`, that is a `DeadlineExceeded`.
    """

    within_s: float


@dataclass(frozen=True, slots=True)
class Tell(Generic[ItemT]):
    """Step: hand this to the caller, who may take its time."""

    item: ItemT


StreamStep: TypeAlias = Open | Read | Send[Any, Any] | Pause | Tell[Any]
Following: TypeAlias = Generator[StreamStep, Any, None]


def go_on(following: Following, outcome: Any) -> StreamStep:
    """Hands the outcome of the last step over and returns the next step.

    Raises:
        GatewayError: there is no use in going on.
    """
    return following.throw(outcome) if isinstance(outcome, GatewayError) else following.send(outcome)


class Followings:
    """The streams of one client, and how often they had to be made anew."""

    def __init__(self, options: ClientOptions, clock: Callable[[], float] = time.monotonic) -> None:
        self._options = options
        self._clock = clock
        self.reconnects = 0
        """Connections made after the first, of all streams together, since this client was made."""

    def status(self, min_interval_s: float) -> Following:
        """Tells `WatchedStatus` and `Outage`; asks again and again where the gateway can't be watched."""

        def take(item: WatchedStatus) -> Iterable[WatchedStatus]:
            return (item,)

        if min_interval_s <= _LONGEST_INTERVAL_S:
            silent_s = max(_STATUS_SILENT_S, min_interval_s)
            # An older gateway knows no such method.
            with suppress(Unsupported):
                yield from self._follow(
                    lambda: Open(WATCH_SYSTEM_STATUS, min_interval_s, True), take, silent_s
                )
        yield from self._ask(max(min_interval_s, _SHORTEST_PAUSE_S))

    def events(self, feed: EventFeed) -> Following:
        """Tells `Event`, `EventGap`, `CaughtUp` and `Outage`."""

        def take(item: Event | EventGap | CaughtUp | None) -> Iterable[Event | EventGap | CaughtUp]:
            return feed.take(item)

        return self._follow(lambda: Open(SUBSCRIBE_EVENTS, feed.wanted(), False), take, _EVENTS_SILENT_S)

    def _ask(self, pause_s: float) -> Following:
        attempt = 0
        heard = False
        while True:
            try:
                status = yield Send(GET_SYSTEM_STATUS, None, self._options.answer_within_s)
            except (Unreachable, DeadlineExceeded, Overloaded) as error:
                if not heard:
                    raise
                attempt += 1
                yield Tell(Outage(error, attempt))
            else:
                heard, attempt = True, 0
                yield Tell(WatchedStatus(status=status, monotonic_ns=None))
            yield Pause(pause_s)

    def _follow(
        self, opening: Callable[[], Open], take: Callable[[Any], Iterable[Any]], silent_s: float
    ) -> Following:
        within_s = silent_s + self._options.answer_within_s
        began_s = self._clock()
        heard = False
        attempt = 0
        pauses = self._options.stream_backoff.pauses()
        while True:
            yield opening()
            try:
                while True:
                    item = yield Read(within_s if heard else self._options.answer_within_s)
                    if attempt or not heard:
                        heard, attempt = True, 0
                        pauses = self._options.stream_backoff.pauses()
                    for piece in take(item):
                        yield Tell(piece)
            except (Unreachable, DeadlineExceeded, Overloaded) as error:
                trouble = error
            attempt += 1
            pause_s = next(pauses)
            if not heard and self._clock() - began_s + pause_s > self._options.backoff.give_up_after_s:
                # A robot that never answered is not one that went away.
                raise trouble
            if heard:
                yield Tell(Outage(trouble, attempt))
            yield Pause(pause_s)
            self.reconnects += 1
