"""Carries out a following for blocking code: a thread receives, the caller iterates."""

import threading
from collections.abc import Callable, Iterator
from typing import Any

import grpc

from console.client.error_table import error_from, stream_error_from
from console.client.errors import Cancelled, GatewayError
from console.client.exchange import Pause, Send
from console.client.following import Following, Open, Read, StreamStep, Tell, go_on
from console.client.mailbox import Mailbox

Begin = Callable[[Open], Any]
"""Makes the call that a step asks for."""
Ask = Callable[[Send[Any, Any]], Any]
"""Carries out a call with one answer, which it returns, or the error."""


def follow(
    following: Following, begin: Begin, send: Ask, target: str, closed: threading.Event
) -> Iterator[Any]:
    """What the following tells, as it comes; ends its call when the caller stops iterating.

    Raises:
        GatewayError: there is no use in going on, or the client was closed.
    """
    call: _Call | None = None
    try:
        step: StreamStep = go_on(following, None)
        while True:
            outcome: Any = None
            match step:
                case Tell(item):
                    yield item
                case Pause(seconds):
                    closed.wait(seconds)
                case Open():
                    if call:
                        call.end()
                    call = _Call(step, begin, target)
                case Send():
                    outcome = send(step)
                case Read(within_s) if call:
                    outcome = call.read(within_s)
            if closed.is_set():
                outcome = Cancelled("this client is closed")
            step = go_on(following, outcome)
    finally:
        if call:
            call.end()


class _Call:
    """One call and the thread that receives it."""

    def __init__(self, step: Open, begin: Begin, target: str) -> None:
        self._box: Mailbox[Any] = Mailbox(newest_only=step.newest_only)
        self._target = target
        self._call: Any = None
        try:
            self._call = begin(step)
        except ValueError as error:
            # gRPC's way of saying that another thread closed the channel just now.
            self._box.end(Cancelled(f"this client was closed: {error}"))
            return
        threading.Thread(target=self._receive, name="gateway-stream", daemon=True).start()

    def read(self, within_s: float) -> Any | GatewayError:
        """The next answer, or why there is none."""
        return self._box.get(within_s)

    def end(self) -> None:
        """Lets the thread go."""
        self._box.abandon()
        if self._call is not None:
            self._call.cancel()

    def _receive(self) -> None:
        try:
            for answer in self._call:
                if not self._box.put(answer):
                    return
        except grpc.RpcError as failure:
            self._box.end(stream_error_from(error_from(failure, self._target, 0.0), self._target))
        else:
            self._box.end(stream_error_from(None, self._target))
