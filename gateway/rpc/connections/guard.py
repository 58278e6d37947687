"""Closes connections without an admitted call, throttles those that flood, keeps away those who persist."""

import asyncio
import logging
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, NoReturn

from gateway.rpc.connections.accepted_sockets import UNLIMITED, AcceptedSockets
from gateway.rpc.connections.admission import Admission
from gateway.rpc.connections.arrivals import Arrivals
from gateway.rpc.connections.packet_filter import ConnectPolicy

_log = logging.getLogger(__name__)

SCAN_EVERY_S: Final = 0.1
"""What is accepted in between is bounded by the server's limit of connections."""
SCAN_AGAIN_S: Final = 0.02
"""Instead of SCAN_EVERY_S when a caller connects, and while there are newcomers: one that is found late has
cost its TLS handshake, and a flood thousands of calls, before those of operators."""
_REST_FACTOR: Final = 4
"""A look is followed by so many times its CPU time without one."""
PENDING_BYTES: Final = 1_048_576
"""What a pending connection may send: a few of the largest requests, or thousands of small ones."""
OVERRUN_BYTES: Final = 16_384
"""Instead of PENDING_BYTES while strangers connect faster than the gateway can take: a hundred calls."""
UNTHROTTLED_BYTES: Final = 65_536
"""What it may send until it is answered slowly: hundreds of calls."""
PLACED_BYTES_PER_S: Final = 262_144
"""What a connection with a place may send: thrice what as many calls take as its limit permits by default.
gRPC resets at once what a connection opens beyond its streams: no brake of the interceptors sees that."""
THROTTLED_BYTES_PER_S: Final = 1024
"""Some ten refusals a second."""
_LOG_EVERY_S: Final = 10.0


@dataclass(frozen=True, slots=True)
class _Watched:
    """What is known of a connection.

    Attributes:
        placed: whether it has a place.
        before: bytes that it had sent when it became pending, or when its newest second began.
        since_s: when that second began, if it has a place.
    """

    placed: bool = False
    before: int = 0
    since_s: float = 0.0
    throttled: bool = False
    cut_off: bool = False


_FRESH: Final = _Watched()


class ConnectionGuard:
    """Looks at the connections that there are: ten times a second, and sooner when callers connect.

    Args:
        admission: knows which must go.
        clock: seconds, monotonic.

    Attributes:
        open: connections at the last look.
        closed: connections that were closed here since the start.
        throttled: connections that were throttled here since the start, again and again some.
        muted: connections that were muted here since the start.
        policy: what the kernel enforces at present.
    """

    def __init__(self, admission: Admission, clock: Callable[[], float] = time.monotonic) -> None:
        self._admission = admission
        self._clock = clock
        self.open = 0
        self.closed = 0
        self.throttled = 0
        self.muted = 0
        self.policy = ConnectPolicy()
        self._wanted = self.policy
        self._watched: dict[str, _Watched] = {}
        """By address."""
        self._logged_s = -math.inf

    async def run(self, port: int) -> NoReturn:
        """Guards the operators' port until cancelled."""
        sockets = AcceptedSockets(port)
        while True:
            try:
                sockets.scan()
                with sockets.listening() as listening, Arrivals(listening) as arrivals:
                    await self._keep_looking(sockets, arrivals)
            except OSError as error:
                # No descriptors are left; the server's limit keeps connections from being the cause.
                self._log(logging.ERROR, f"connections can't be examined: {error}")
                await asyncio.sleep(SCAN_EVERY_S)

    async def _keep_looking(self, sockets: AcceptedSockets, arrivals: Arrivals) -> NoReturn:
        """Looks until cancelled.

        Raises:
            OSError: the connections can't be listed.
        """
        while True:
            done, began_s = self.closed + self.throttled + self.muted, time.thread_time()
            self.look(sockets)
            if self.closed + self.throttled + self.muted > done:
                self._report()
            # Not by the clock: a look that the attackers' load draws out must not put the next one off.
            rest_s = min(SCAN_EVERY_S, max(SCAN_AGAIN_S, (time.thread_time() - began_s) * _REST_FACTOR))
            if self._admission.has_newcomers() or await arrivals.next(SCAN_EVERY_S):
                # After an arrival, too: meanwhile gRPC accepts the connection, and what comes with it.
                await asyncio.sleep(rest_s)

    def look(self, sockets: AcceptedSockets) -> None:
        """Looks at all connections once.

        Raises:
            OSError: they can't be listed.
        """
        present = sockets.scan()
        surplus = set(self._admission.surplus(present))
        flooding = self._restrain(sockets, present)
        surplus.update(self._admission.pending_of_blocked())
        # First, so that none that is closed comes back at once.
        self._filter(sockets)
        closed = sum(sockets.close(address) for address in surplus)
        self.open = len(present) - closed
        self.closed += closed
        for address in flooding:
            if address not in surplus:
                self._cut_off(sockets, address)

    def _restrain(self, sockets: AcceptedSockets, present: list[str]) -> list[str]:
        """Throttles connections that have sent much, and returns those that have sent too much, or flood."""
        pending, flooding = set(self._admission.pending()), []
        most = OVERRUN_BYTES if self._admission.overrun else PENDING_BYTES
        watched: dict[str, _Watched] = {}
        for address in present:
            state = self._watched.get(address, _FRESH)
            received = sockets.received_bytes(address)
            if address not in pending:
                state = self._of_placed(sockets, address, state, received)
                if self._admission.floods(address) and not state.cut_off:
                    flooding.append(address)
                    state = replace(state, cut_off=True)
                watched[address] = state
                continue
            if state.placed:
                state = _Watched(before=received, throttled=state.throttled)
            sent = received - state.before
            if (sent > most or self._admission.floods(address)) and not state.cut_off:
                self._admission.note_flood(address)
                flooding.append(address)
                state = replace(state, cut_off=True)
            elif sent > UNTHROTTLED_BYTES and not state.throttled:
                sockets.throttle(address, THROTTLED_BYTES_PER_S)
                self.throttled += 1
                state = replace(state, throttled=True)
            watched[address] = state
        self._watched = watched
        return flooding

    def _of_placed(self, sockets: AcceptedSockets, address: str, state: _Watched, received: int) -> _Watched:
        """Throttles a connection with a place while it sends more than it may."""
        now_s = self._clock()
        if not state.placed:
            if state.throttled:
                sockets.throttle(address, UNLIMITED)
            return _Watched(placed=True, before=received, since_s=now_s)
        excessive = received - state.before > PLACED_BYTES_PER_S
        if excessive and not state.throttled:
            sockets.throttle(address, THROTTLED_BYTES_PER_S)
            self.throttled += 1
        if now_s - state.since_s < 1.0:
            return replace(state, throttled=state.throttled or excessive)
        if state.throttled and not excessive:
            sockets.throttle(address, UNLIMITED)
        return replace(state, before=received, since_s=now_s, throttled=excessive)

    def _filter(self, sockets: AcceptedSockets) -> None:
        """Makes the kernel keep away those who may not connect now."""
        wanted = self._admission.connect_policy()
        if wanted == self._wanted:
            return
        # Where the kernel does not permit it, connections are closed as they come.
        self.policy = wanted if sockets.apply(wanted) else ConnectPolicy()
        self._wanted = wanted

    def _cut_off(self, sockets: AcceptedSockets, address: str) -> None:
        """Mutes a connection of a trusted address, or closes it where the kernel does not permit that."""
        if sockets.mute(address):
            self.muted += 1
        elif sockets.close(address):
            self.closed += 1

    def _report(self) -> None:
        self._log(
            logging.WARNING,
            f"of connections without an admitted call, {self.closed} were closed since the start, "
            f"{self.throttled} were throttled and {self.muted} muted because they sent too much; "
            f"{self.open} are open, {len(self.policy.blocked)} addresses blocked, and 1 in "
            f"{self.policy.one_in} of the attempts of other strangers to connect is accepted",
        )

    def _log(self, level: int, message: str) -> None:
        """Logs a message, unless there was one lately: attackers must not fill the log."""
        now_s = time.monotonic()
        if now_s - self._logged_s >= _LOG_EVERY_S:
            _log.log(level, "%s", message)
            self._logged_s = now_s
