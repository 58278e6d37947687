"""Which operators are present: addresses that have had a stream open for a while; they join and leave."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from common.interceptors import Interceptor
from common.token_bucket import TokenBucket
from gateway.rpc.calls.call import CallContext
from gateway.rpc.calls.methods import Method
from gateway.rpc.calls.ports import EventSink
from gateway.status.event import ClientJoined, ClientLeft, Event
from gateway.status.fault import Severity

JOINED_AFTER_S: Final = 2.0
"""How long a stream has been open before its client has joined: one look at the status, or a client that
reconnects again and again, is no event."""
REPORTED: Final = 10
"""Clients of one caller, a name or an address prefix without one, that are reported one by one."""
REPORTED_EVERY_S: Final = 60.0
"""After them one each minute, with the number of the others: they displace no other event soon."""
MAX_CALLERS: Final = 64
"""That are kept apart; new ones beyond them share the reports of one."""
_COMPONENT: Final = "gateway"
_OTHERS: Final = ""


@dataclass(slots=True)
class _Client:
    since_s: float
    name: str
    caller: str
    streams: int = 0
    joined: bool = False
    reported: bool = False


@dataclass(slots=True)
class _Reports:
    """Those of one caller.

    Attributes:
        unreported: clients that have joined since the last report.
    """

    bucket: TokenBucket
    unreported: int = 0


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
        self._reports: dict[str, _Reports] = {}
        """By caller."""

    def applies_to(self, method: Method) -> bool:
        """Returns whether the method is a stream of the contract."""
        return method.streaming and method.of_contract

    def on_call(self, call: CallContext) -> None:
        """Counts an open stream."""
        name = call.principal.name if call.principal else ""
        client = self._clients.setdefault(call.peer.address, _Client(self._clock(), name, call.caller))
        client.streams += 1

    def on_end(self, call: CallContext, _error: BaseException | None) -> None:
        """Reports a client that had joined and closes its last stream."""
        address = call.peer.address
        client = self._clients[address]
        client.streams -= 1
        if client.streams == 0:
            del self._clients[address]
            if client.reported:
                self._note("left", ClientLeft(address, client.name))

    def report_joined(self) -> None:
        """Reports clients that have been here long enough; to be called a few times a second."""
        before_s = self._clock() - JOINED_AFTER_S
        for address, client in self._clients.items():
            if not client.joined and client.since_s <= before_s:
                client.joined = True
                self._report(address, client)

    def _report(self, address: str, client: _Client) -> None:
        """Reports a client that has joined, or counts it where its caller has had too many reports."""
        reports, now_s = self._reports_of(client.caller), self._clock()
        if not reports.bucket.take(now_s, capacity=REPORTED, refill_per_s=1 / REPORTED_EVERY_S):
            reports.unreported += 1
            return
        more = f" ({reports.unreported} times more since the last report)" if reports.unreported else ""
        reports.unreported = 0
        client.reported = True
        self._note(f"joined{more}", ClientJoined(address, client.name))

    def _reports_of(self, caller: str) -> _Reports:
        now_s = self._clock()
        if caller not in self._reports and len(self._reports) >= MAX_CALLERS:
            # A bucket that is full may be forgotten: a new one holds no more.
            self._reports = {
                name: each
                for name, each in self._reports.items()
                if now_s - each.bucket.updated_s < REPORTED * REPORTED_EVERY_S
            }
            if len(self._reports) >= MAX_CALLERS:
                caller = _OTHERS
        return self._reports.setdefault(caller, _Reports(TokenBucket(REPORTED, now_s)))

    def _note(self, what: str, detail: ClientJoined | ClientLeft) -> None:
        message = f"{detail.who or detail.address} {what}"
        self._events.note(Event(Severity.INFO, _COMPONENT, message, detail))
