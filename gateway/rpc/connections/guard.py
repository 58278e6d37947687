"""Closes connections without an admitted call, throttles and mutes those that flood, blocks who persists."""

import asyncio
import logging
import math
import time
from dataclasses import dataclass, replace
from typing import Final, NoReturn

from gateway.rpc.connections.accepted_sockets import UNLIMITED, AcceptedSockets
from gateway.rpc.connections.admission import Admission

_log = logging.getLogger(__name__)

SCAN_EVERY_S: Final = 0.1
"""What is accepted in between is bounded by the server's limit of connections."""
PENDING_BYTES: Final = 1_048_576
"""What a pending connection may send: a few of the largest requests, or thousands of small ones."""
UNTHROTTLED_BYTES: Final = 65_536
"""What it may send until it is answered slowly: hundreds of calls."""
THROTTLED_BYTES_PER_S: Final = 1024
"""Some ten refusals a second."""
_LOG_EVERY_S: Final = 10.0


@dataclass(frozen=True, slots=True)
class _Watched:
    """What is known of a connection.

    Attributes:
        placed: whether it has a place.
        before: bytes that it had sent when it became pending.
    """

    placed: bool = False
    before: int = 0
    throttled: bool = False
    cut_off: bool = False


_FRESH: Final = _Watched()
_PLACED: Final = _Watched(placed=True)


class ConnectionGuard:
    """Looks at the connections that there are, ten times a second.

    Args:
        admission: knows which must go.

    Attributes:
        open: connections at the last look.
        closed: connections that were closed here since the start.
        throttled: connections that were throttled here since the start.
        muted: connections that were muted here since the start.
        blocked: addresses from which no connection is accepted at present.
    """

    def __init__(self, admission: Admission) -> None:
        self._admission = admission
        self.open = 0
        self.closed = 0
        self.throttled = 0
        self.muted = 0
        self.blocked = 0
        self._applied: frozenset[str] = frozenset()
        """Prefixes in the packet filter."""
        self._watched: dict[str, _Watched] = {}
        """By address."""
        self._logged_s = -math.inf

    async def run(self, port: int) -> NoReturn:
        """Guards the operators' port until cancelled."""
        sockets = AcceptedSockets(port)
        while True:
            await asyncio.sleep(SCAN_EVERY_S)
            try:
                present = sockets.scan()
            except OSError as error:
                # No descriptors are left; the server's limit keeps connections from being the cause.
                self._log(logging.ERROR, f"connections can't be examined: {error}")
                continue
            done = self.closed + self.throttled + self.muted
            closed = sum(sockets.close(address) for address in self._admission.surplus(present))
            self.open = len(present) - closed
            self.closed += closed
            self.restrain(sockets, present)
            self.block(sockets)
            if self.closed + self.throttled + self.muted > done:
                self._log(
                    logging.WARNING,
                    f"of connections without an admitted call, {self.closed} were closed since the start, "
                    f"{self.throttled} were throttled and {self.muted} muted because they sent too much; "
                    f"{self.open} are open, and {self.blocked} addresses are blocked",
                )

    def restrain(self, sockets: AcceptedSockets, present: list[str]) -> None:
        """Throttles pending connections that have sent much, and cuts off those that have sent too much."""
        pending = set(self._admission.pending())
        watched: dict[str, _Watched] = {}
        for address in present:
            state = self._watched.get(address, _FRESH)
            if address not in pending:
                if state.throttled:
                    sockets.throttle(address, UNLIMITED)
                watched[address] = _PLACED
                continue
            received = sockets.received_bytes(address)
            if state.placed:
                state = _Watched(before=received)
            sent = received - state.before
            if (sent > PENDING_BYTES or self._admission.floods(address)) and not state.cut_off:
                self._cut_off(sockets, address)
                state = replace(state, cut_off=True)
            elif sent > UNTHROTTLED_BYTES and not state.throttled:
                sockets.throttle(address, THROTTLED_BYTES_PER_S)
                self.throttled += 1
                state = replace(state, throttled=True)
            watched[address] = state
        self._watched = watched

    def block(self, sockets: AcceptedSockets) -> None:
        """Blocks the addresses that are on the list, and no others."""
        wanted = self._admission.blocked()
        if wanted == self._applied:
            return
        # Where the kernel does not permit it, connections are closed as they come.
        self.blocked = len(wanted) if sockets.block(wanted) else 0
        self._applied = wanted

    def _cut_off(self, sockets: AcceptedSockets, address: str) -> None:
        """Mutes the connection, or closes it where the kernel does not permit that."""
        if sockets.mute(address):
            self.muted += 1
        elif sockets.close(address):
            self.closed += 1

    def _log(self, level: int, message: str) -> None:
        """Logs a message, unless there was one lately: attackers must not fill the log."""
        now_s = time.monotonic()
        if now_s - self._logged_s >= _LOG_EVERY_S:
            _log.log(level, "%s", message)
            self._logged_s = now_s
