"""The client for ordinary code: every method returns when the answer is there."""

import threading
from collections.abc import Iterator
from types import TracebackType
from typing import Any, Self, TypeVar

import grpc

from console.client.blocking_stream import follow
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


class GatewayClient:
    """A robot's gateway, for blocking code and for threads.

    The connection is made at the first call and made again whenever it breaks.

    Example:
        with GatewayClient("robot.local") as robot:
            print(robot.status().health.summary)
            change = robot.enable_preview(PreviewProfile.BALANCED)
            print(change.preview.endpoint)

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
        self._closed = threading.Event()
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

    def status(self) -> SystemStatus:
        """Everything the gateway knows about the robot."""
        return self._run(self._exchanges.status())

    def overlay(self) -> OverlaySnapshot:
        """Status, detections and the newest events, at one instant."""
        return self._run(self._exchanges.overlay())

    def info(self) -> GatewayInfo:
        """What is known of the gateway program: its build, its calls, its configuration."""
        return self._run(self._exchanges.info())

    def enable_preview(
        self, profile: PreviewProfile = PreviewProfile.UNKNOWN, *, settle_within_s: float = 10.0
    ) -> PreviewChange:
        """Turns the preview on, or changes its profile, and waits until frames leave or it is known to fail.

        Args:
            profile: UNKNOWN keeps the current one.
            settle_within_s: how long to watch; 0 returns the gateway's first answer.

        Returns:
            The gateway's message and the preview as last seen: RUNNING, FAULTED (see `last_error`), or
            still STARTING when time ran out.
        """
        return self._run(self._exchanges.set_preview(PreviewWish(True, profile), settle_within_s))

    def disable_preview(self, *, settle_within_s: float = 10.0) -> PreviewChange:
        """Turns the preview off and waits until its port is free; 0 returns the gateway's first answer."""
        return self._run(self._exchanges.set_preview(PreviewWish(False), settle_within_s))

    def ping(self) -> Offset:
        """Asks for the robot's time. `clock` learns from each call, so that a few of them make it better."""
        return self._run(self._exchanges.ping(self.clock))

    def watch_status(self, min_interval_s: float = 0.1) -> Iterator[WatchedStatus | Outage]:
        """The status whenever something has changed and once a second: the first at once, then for ever.

        Who takes its time gets the newest next. The connection is made again whenever it breaks; meanwhile
        the `Outage`s are told, one per attempt. Ending the iteration ends the stream.

        Args:
            min_interval_s: the least time between two of them; the gateway looks 20 times a second.

        Raises:
            GatewayError: no gateway answers at the beginning, or it refuses; not for one that went away.
        """
        return self._follow(self._followings.status(min_interval_s))

    def events(
        self, after: EventPosition | None = None, *, least: FaultSeverity = FaultSeverity.UNKNOWN
    ) -> Iterator[Event | EventGap | CaughtUp | Outage]:
        """What happens, each event once and in order, for ever; what can't be had is told as an `EventGap`.

        `CaughtUp` comes when everything that had happened before was told, and as a sign of life. Each item
        but an `Outage` has the position to go on from, for another client or another run of this program.

        Args:
            after: the position of the last item that was received; None begins with what the gateway keeps.
            least: events that matter less are left out; UNKNOWN leaves out nothing.

        Raises:
            GatewayError: as `watch_status`.
        """
        return self._follow(self._followings.events(EventFeed(after, least)))

    def close(self) -> None:
        """Ends the connection. Calls under way in other threads end with `Cancelled`."""
        self._closed.set()
        self._channel.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _follow(self, following: Following) -> Iterator[Any]:
        return follow(following, self._begin, self._send, self.target, self._closed)

    def _begin(self, step: Open) -> Any:
        return self._streams[step.method.name](step.request, metadata=self._metadata)

    def _run(self, exchange: Exchange[ResultT]) -> ResultT:
        step = advance(exchange, None)
        while not isinstance(step, Done):
            step = advance(exchange, self._carry_out(step))
        return step.result

    def _carry_out(self, step: Step) -> Any:
        if self._closed.is_set():
            return Cancelled("this client is closed")
        if isinstance(step, Pause):
            self._closed.wait(step.seconds)
            return None
        return self._send(step)

    def _send(self, step: Send[Any, Any]) -> Any | GatewayError:
        try:
            return self._calls[step.method.name](
                step.request, timeout=step.timeout_s, metadata=self._metadata
            )
        except grpc.RpcError as failure:
            return error_from(failure, self.target, step.timeout_s)
        except ValueError as error:
            # gRPC's way of saying that another thread closed the channel just now.
            if not self._closed.is_set():
                raise
            return Cancelled(f"this client was closed: {error}")


def _channel(target: str, options: ClientOptions, credentials: Credentials) -> grpc.Channel:
    encryption = credentials.channel_credentials(target)
    if encryption is None:
        return grpc.insecure_channel(target, options=options.channel_options())
    return grpc.secure_channel(target, encryption, options=options.channel_options())
