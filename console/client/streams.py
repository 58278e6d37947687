"""Streams that outlive their connections: they reconnect for as long as they are read."""

import time
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing
from dataclasses import dataclass
from typing import Any, Final, Protocol, TypeVar

from console.client.errors import DeadlineExceeded, GatewayError, Overloaded, Unreachable, Unsupported
from console.client.event_feed import EventFeed
from console.client.mapping.methods import (
    GET_SYSTEM_STATUS,
    NO_FIELDS,
    SUBSCRIBE_EVENTS,
    WATCH_SYSTEM_STATUS,
    Method,
    watch_request,
)
from console.client.options import ClientOptions
from console.client.results import CaughtUp, Event, EventGap, WatchedStatus
from console.client.unary import UnaryTransport

ResultT = TypeVar("ResultT")

_LONGEST_INTERVAL_S: Final = 60.0
"""Gateways refuse slower subscriptions; beyond it the status is polled."""
_SHORTEST_POLL_S: Final = 0.05
"""Shortest polling interval of a gateway without WatchSystemStatus."""
_EVENTS_SILENT_S: Final = 5.0
"""The gateway's keepalive interval on SubscribeEvents."""
_STATUS_SILENT_S: Final = 1.0
"""The gateway's keepalive interval on WatchSystemStatus, or the requested interval if that is longer."""


@dataclass(frozen=True, slots=True)
class Outage:
    """The connection was lost, or another attempt to restore it failed. The stream goes on by itself.

    Attributes:
        error: Why.
        attempt: 1 for the loss itself, then one more for each attempt that failed.
    """

    error: GatewayError
    attempt: int


class ResponseStream(Protocol):
    """One server-streaming call."""

    async def read(self, within_s: float) -> Any:
        """Returns the next item, or raises a `GatewayError`."""

    def cancel(self) -> None:
        """Ends the call."""


class StreamTransport(UnaryTransport, Protocol):
    """What streams need of a transport."""

    def open(self, method: Method[Any], request: bytes, *, newest_only: bool) -> ResponseStream:
        """Starts a server-streaming call."""


class Streams:
    """The streams of one client.

    Args:
        transport: Opens single connections.
        options: Deadlines and backoff.
        clock: Monotonic seconds.
    """

    def __init__(
        self, transport: StreamTransport, options: ClientOptions, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._transport = transport
        self._options = options
        self._clock = clock
        self.reconnects = 0
        """Connections after the first one of each stream, of all streams together."""

    async def status(
        self, interval_s: float, *, include_detections: bool = False
    ) -> AsyncGenerator[WatchedStatus | Outage]:
        """Yields statuses and outages; polls where the gateway does not stream its status."""
        if interval_s <= _LONGEST_INTERVAL_S:
            silent_s = max(_STATUS_SILENT_S, interval_s)
            request = watch_request(interval_s, include_detections=include_detections)
            watched = self._reconnecting(WATCH_SYSTEM_STATUS, lambda: request, silent_s, newest_only=True)
            try:
                async with aclosing(watched):
                    async for item in watched:
                        yield item
            except Unsupported:
                # The gateway is older than this method.
                pass
        async with aclosing(self._poll(max(interval_s, _SHORTEST_POLL_S))) as polled:
            async for answer in polled:
                yield answer

    async def events(self, feed: EventFeed) -> AsyncGenerator[Event | EventGap | CaughtUp | Outage]:
        """Yields events, gaps, catch-up marks and outages; each connection resumes at the feed's position."""
        received = self._reconnecting(SUBSCRIBE_EVENTS, feed.request, _EVENTS_SILENT_S, newest_only=False)
        async with aclosing(received):
            async for item in received:
                if isinstance(item, Outage):
                    yield item
                else:
                    for piece in feed.take(item):
                        yield piece

    async def _poll(self, interval_s: float) -> AsyncGenerator[WatchedStatus | Outage]:
        failures = 0
        answered = False
        while True:
            try:
                within_s = self._options.answer_within_s
                status = await self._transport.call(GET_SYSTEM_STATUS, NO_FIELDS, within_s)
            except (Unreachable, DeadlineExceeded, Overloaded) as error:
                if not answered:
                    raise
                failures += 1
                yield Outage(error, failures)
            else:
                answered, failures = True, 0
                yield WatchedStatus(status=status, monotonic_ns=None)
            await self._transport.sleep(interval_s)

    async def _reconnecting(
        self,
        method: Method[ResultT],
        request: Callable[[], bytes],
        silent_s: float,
        *,
        newest_only: bool,
    ) -> AsyncGenerator[ResultT | Outage]:
        within_s = silent_s + self._options.answer_within_s
        began_s = self._clock()
        answered = False
        backoff = self._options.stream_backoff.start()
        while True:
            responses = self._transport.open(method, request(), newest_only=newest_only)
            try:
                while True:
                    item = await responses.read(within_s if answered else self._options.answer_within_s)
                    answered = True
                    backoff.reset()
                    yield item
            except (Unreachable, DeadlineExceeded, Overloaded) as error:
                reason = error
            finally:
                responses.cancel()
            pause_s = backoff.next_s()
            # A robot that never answered is reported as absent, not as lost.
            if answered:
                yield Outage(reason, backoff.failures)
            elif self._clock() - began_s + pause_s > self._options.backoff.give_up_after_s:
                raise reason
            await self._transport.sleep(pause_s)
            self.reconnects += 1
