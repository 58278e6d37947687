"""The client for ordinary code: every method returns when the answer is there."""

import threading
from types import TracebackType
from typing import Any, Self, TypeVar

import grpc

from console.client.error_table import error_from
from console.client.errors import Cancelled, GatewayError
from console.client.exchange import Done, Exchange, Exchanges, Pause, Send, Step, advance
from console.client.mapping.methods import METHODS, PreviewWish
from console.client.options import ClientOptions
from console.client.results import GatewayInfo, OverlaySnapshot, PreviewChange, PreviewProfile, SystemStatus
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

    Raises:
        UserError: the target is not an address. Every method raises a `GatewayError`.
    """

    def __init__(self, target: str = DEFAULT_TARGET, options: ClientOptions | None = None) -> None:
        options = options or ClientOptions()
        self.target = parse_target(target)
        self._exchanges = Exchanges(options)
        self._closed = threading.Event()
        self._channel = grpc.insecure_channel(self.target, options=options.channel_options())
        self._calls = {
            method.name: self._channel.unary_unary(
                method.path, request_serializer=method.encode, response_deserializer=method.decode
            )
            for method in METHODS
        }

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
            return self._calls[step.method.name](step.request, timeout=step.timeout_s)
        except grpc.RpcError as failure:
            return error_from(failure, self.target, step.timeout_s)
        except ValueError as error:
            # gRPC's way of saying that another thread closed the channel just now.
            if not self._closed.is_set():
                raise
            return Cancelled(f"this client was closed: {error}")
