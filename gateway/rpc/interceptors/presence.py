"""Which operators are present: addresses that have had a stream open for a while; they join and leave."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from common.interceptors import Interceptor
from gateway.rpc.calls.call import CallContext
from gateway.rpc.calls.methods import Method
from gateway.rpc.calls.ports import EventSink
from gateway.status.event import ClientJoined, ClientLeft, Event
from gateway.status.fault import Severity

JOINED_AFTER_S: Final = 2.0
"""How long a stream has been open before its client has joined: one look at the status, or a client that
reconnects again and again, is no event."""
_COMPONENT: Final = "gateway"


@dataclass(slots=True)
class _Client:
    since_s: float
    name: str
    streams: int = 0
    joined: bool = False


class Presence(Interceptor[CallContext]):
    """Reports clients that join and leave. The innermost interceptor: it sees admitted calls alone.

    Args:
        events: where it reports.
        clock: seconds, monotonic.
    """

    def __init__(self, events: EventSink, clock: Callable[[], float] = time.monotonic) -> None:
        self._events = events
        self._clock = clock
        self._clients: dict[str, _Client] = {}

    def applies_to(self, method: Method) -> bool:
        """Returns whether the method is a stream of the contract."""
        return method.streaming and method.of_contract

    def on_call(self, call: CallContext) -> None:
        """Counts an open stream."""
        name = call.principal.name if call.principal else ""
        client = self._clients.setdefault(call.peer.address, _Client(self._clock(), name))
        client.streams += 1

    def on_end(self, call: CallContext, _error: BaseException | None) -> None:
        """Reports a client that had joined and closes its last stream."""
        address = call.peer.address
        client = self._clients[address]
        client.streams -= 1
        if client.streams == 0:
            del self._clients[address]
            if client.joined:
                self._note("left", ClientLeft(address, client.name))

    def report_joined(self) -> None:
        """Reports clients that have been here long enough; to be called a few times a second."""
        before_s = self._clock() - JOINED_AFTER_S
        for address, client in self._clients.items():
            if not client.joined and client.since_s <= before_s:
                client.joined = True
                self._note("joined", ClientJoined(address, client.name))

    def _note(self, what: str, detail: ClientJoined | ClientLeft) -> None:
        message = f"{detail.who or detail.address} {what}"
        self._events.note(Event(Severity.INFO, _COMPONENT, message, detail))
