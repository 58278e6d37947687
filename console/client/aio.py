"""The client for asyncio: the same methods, to be awaited."""

import asyncio
from collections.abc import AsyncIterator
from types import TracebackType
from typing import Any, Self, TypeVar

import grpc

from console.client.aio_stream import follow
from console.client.clock import Clock, Offset
from console.client.credentials import NO_CREDENTIALS, Credentials
from console.client.error_table import error_from
from console.client.errors import Cancelled, GatewayError
from console.client.exchange import Done, Exchange, Exchanges, Pause, Send, Step, advance
from console.client.feed import EventFeed
from console.client.following import Following, Followings, Open, Outage
from console.client.mapping.methods import METHODS, STREAMS, PreviewWish
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
from console.client.target import DEFAULT_TARGET, parse_target

ResultT = TypeVar("ResultT")


class AsyncGatewayClient:
    """A robot's gateway, for one asyncio loop. Make it inside the loop that uses it.

    The connection is made at the first call and made again whenever it breaks. Cancelling a task that waits
    for an answer cancels the call.

    Example:
        async with AsyncGatewayClient("robot.local") as robot:
            status, overlay = await asyncio.gather(robot.status(), robot.overlay())

    Args:
        target: HOST or HOST:PORT.
        options: how patient to be.
        credentials: what proves who asks; None where the robot doesn't want to know.

    Raises:
        UserError: the target is not an address, or the credentials would be sent in the clear. Every method
            raises a `GatewayError`.
    """

    def __init__(
        self,
        target: str = DEFAULT_TARGET,
        options: ClientOptions | None = None,
        credentials: Credentials | None = None,
    ) -> None:
        options = options or ClientOptions()
        self.target = parse_target(target)
        self._exchanges = Exchanges(options)
        self._followings = Followings(options)
        self.clock = Clock()
        self._closed = asyncio.Event()
        self._metadata = (credentials or NO_CREDENTIALS).metadata()
        self._channel = _channel(self.target, options, credentials or NO_CREDENTIALS)
        self._calls = {
            method.name: self._channel.unary_unary(
                method.path, request_serializer=method.encode, response_deserializer=method.decode
            )
            for method in METHODS
        }
        self._streams = {
            method.name: self._channel.unary_stream(
                method.path, request_serializer=method.encode, response_deserializer=method.decode
            )
            for method in STREAMS
        }

    @property
    def reconnects(self) -> int:
        """Connections that streams made after their first one, of all streams together."""
        return self._followings.reconnects

    @property
    def retries(self) -> int:
        """Attempts beyond the first, of all calls together."""
        return self._exchanges.retries

    async def status(self) -> SystemStatus:
        """Everything the gateway knows about the robot."""
        return await self._run(self._exchanges.status())

    async def overlay(self) -> OverlaySnapshot:
        """Status, detections and the newest events, at one instant."""
        return await self._run(self._exchanges.overlay())

    async def info(self) -> GatewayInfo:
        """What is known of the gateway program: its build, its calls, its configuration."""
        return await self._run(self._exchanges.info())

    async def enable_preview(
        self, profile: PreviewProfile = PreviewProfile.UNKNOWN, *, settle_within_s: float = 10.0
    ) -> PreviewChange:
        """As `GatewayClient.enable_preview`."""
        return await self._run(self._exchanges.set_preview(PreviewWish(True, profile), settle_within_s))

    async def disable_preview(self, *, settle_within_s: float = 10.0) -> PreviewChange:
        """As `GatewayClient.disable_preview`."""
        return await self._run(self._exchanges.set_preview(PreviewWish(False), settle_within_s))

    async def ping(self) -> Offset:
        """Asks for the robot's time. `clock` learns from each call, so that a few of them make it better."""
        return await self._run(self._exchanges.ping(self.clock))

    def watch_status(self, min_interval_s: float = 0.1) -> AsyncIterator[WatchedStatus | Outage]:
        """As `GatewayClient.watch_status`."""
        return self._follow(self._followings.status(min_interval_s))

    def events(
        self, after: EventPosition | None = None, *, least: FaultSeverity = FaultSeverity.UNKNOWN
    ) -> AsyncIterator[Event | EventGap | CaughtUp | Outage]:
        """As `GatewayClient.events`."""
        return self._follow(self._followings.events(EventFeed(after, least)))

    async def close(self) -> None:
        """Ends the connection. Calls under way in other tasks end with `Cancelled`."""
        self._closed.set()
        await self._channel.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        await self.close()

    def _follow(self, following: Following) -> AsyncIterator[Any]:
        return follow(following, self._begin, self._send, self.target, self._closed)

    def _begin(self, step: Open) -> Any:
        return self._streams[step.method.name](step.request, metadata=self._metadata)

    async def _run(self, exchange: Exchange[ResultT]) -> ResultT:
        step = advance(exchange, None)
        while not isinstance(step, Done):
            step = advance(exchange, await self._carry_out(step))
        return step.result

    async def _carry_out(self, step: Step) -> Any:
        if self._closed.is_set():
            return Cancelled("this client is closed")
        if isinstance(step, Pause):
            await asyncio.sleep(step.seconds)
            return None
        return await self._send(step)

    async def _send(self, step: Send[Any, Any]) -> Any | GatewayError:
        try:
            return await self._calls[step.method.name](
                step.request, timeout=step.timeout_s, metadata=self._metadata
            )
        except grpc.RpcError as failure:
            return error_from(failure, self.target, step.timeout_s)
        except asyncio.CancelledError:
            # gRPC says so, too, when another task closed the channel under this call.
            if not self._closed.is_set() or _being_cancelled():
                raise
            return Cancelled("this client was closed")


def _being_cancelled() -> bool:
    task = asyncio.current_task()
    return task is not None and task.cancelling() > 0


def _channel(target: str, options: ClientOptions, credentials: Credentials) -> grpc.aio.Channel:
    encryption = credentials.channel_credentials(target)
    if encryption is None:
        return grpc.aio.insecure_channel(target, options=options.channel_options())
    return grpc.aio.secure_channel(target, encryption, options=options.channel_options())
