"""The blocking client: a facade over the asyncio client, which runs in a thread of its own."""

import weakref
from collections.abc import AsyncIterator, Iterator
from contextlib import suppress
from types import TracebackType
from typing import Any, Self, TypeVar

from console.client.aio import AsyncGatewayClient
from console.client.clock import Offset
from console.client.credentials import Credentials
from console.client.errors import Cancelled
from console.client.loop_thread import LoopThread
from console.client.options import ClientOptions
from console.client.results import (
    CaughtUp,
    Event,
    EventGap,
    EventPosition,
    FaultSeverity,
    GatewayInfo,
    OverlaySnapshot,
    PreviewChange,
    PreviewProfile,
    SystemStatus,
    WatchedStatus,
)
from console.client.streams import Outage
from console.client.target import DEFAULT_TARGET

ItemT = TypeVar("ItemT")


class GatewayClient:
    """Client of one robot's gateway, for blocking code. May be used from several threads at once.

    Every method does what that of `AsyncGatewayClient` does, and returns when the answer is there.

    Example:
        with GatewayClient("robot.local") as robot:
            print(robot.status().health.summary)
            change = robot.enable_preview(PreviewProfile.BALANCED)
            print(change.preview.endpoint)

    Args:
        target: HOST or HOST:PORT.
        options: Deadlines, retries and keepalive.
        credentials: Token and certificates; None for a robot without authentication.

    Raises:
        UserError: The target is not an address, or the credentials would be sent in the clear. Every method
            raises a `GatewayError`.
    """

    def __init__(
        self,
        target: str = DEFAULT_TARGET,
        options: ClientOptions | None = None,
        credentials: Credentials | None = None,
    ) -> None:
        async def create() -> AsyncGatewayClient:
            return AsyncGatewayClient(target, options, credentials)

        self._loop = LoopThread()
        # Also at the end of a program that does not close its client.
        self._stop = weakref.finalize(self, self._loop.stop)
        try:
            self._client = self._loop.run(create())
        except BaseException:
            self._stop()
            raise
        self.target = self._client.target
        self.clock = self._client.clock

    @property
    def reconnects(self) -> int:
        """Connections after the first one of each stream, of all streams together."""
        return self._client.reconnects

    @property
    def retries(self) -> int:
        """Attempts beyond the first, of all calls together."""
        return self._client.retries

    def status(self) -> SystemStatus:
        """Returns the status of the whole robot."""
        return self._loop.run(self._client.status())

    def overlay(self) -> OverlaySnapshot:
        """Returns status, detections and the newest events, all of one instant."""
        return self._loop.run(self._client.overlay())

    def info(self) -> GatewayInfo:
        """Returns the gateway program's build, call counts and configuration."""
        return self._loop.run(self._client.info())

    def enable_preview(
        self, profile: PreviewProfile = PreviewProfile.UNKNOWN, *, settle_within_s: float = 10.0
    ) -> PreviewChange:
        """Turns the preview on, or changes its profile, and waits until frames leave or the start failed."""
        return self._loop.run(self._client.enable_preview(profile, settle_within_s=settle_within_s))

    def disable_preview(self, *, settle_within_s: float = 10.0) -> PreviewChange:
        """Turns the preview off and waits until its port is free; 0 returns the gateway's first answer."""
        return self._loop.run(self._client.disable_preview(settle_within_s=settle_within_s))

    def ping(self) -> Offset:
        """Returns the offset of the robot's clock. Each call improves `clock`."""
        return self._loop.run(self._client.ping())

    def watch_status(self, min_interval_s: float = 0.1) -> Iterator[WatchedStatus | Outage]:
        """Yields the status at once, on every change, and once a second without one. Never ends."""
        return self._iterate(self._client.watch_status(min_interval_s))

    def events(
        self, after: EventPosition | None = None, *, least: FaultSeverity = FaultSeverity.UNKNOWN
    ) -> Iterator[Event | EventGap | CaughtUp | Outage]:
        """Yields each event once and in order; events that are not available any more, as an `EventGap`."""
        return self._iterate(self._client.events(after, least=least))

    def close(self) -> None:
        """Closes the connection. Pending calls and streams in other threads end with `Cancelled`."""
        with suppress(Cancelled):
            self._loop.run(self._client.close())
        self._loop.stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _iterate(self, items: AsyncIterator[ItemT]) -> Iterator[ItemT]:
        async def next_item() -> ItemT:
            return await anext(items)

        try:
            while True:
                yield self._loop.run(next_item())
        finally:
            # Not waited for: the garbage collector may close this iterator in the loop's own thread.
            with suppress(Cancelled):
                self._loop.submit(_close(items))


async def _close(items: Any) -> None:
    await items.aclose()
