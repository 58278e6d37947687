"""Closes connections that take room without making calls that are admitted, and mutes those that flood."""

import asyncio
import logging
import math
import time
from typing import Final, NoReturn

from gateway.rpc.connections.accepted_sockets import AcceptedSockets
from gateway.rpc.connections.admission import Admission

_log = logging.getLogger(__name__)

SCAN_EVERY_S: Final = 0.1
"""What is accepted in between is bounded by the server's limit of connections."""
PENDING_BYTES: Final = 1_048_576
"""What a pending connection may send: a few of the largest requests, or thousands of small ones."""
_LOG_EVERY_S: Final = 10.0
_PLACED: Final = 0.0
"""Limit of a connection that has a place, until it loses that: none."""


class ConnectionGuard:
    """Looks at the connections that there are, ten times a second.

    Args:
        admission: knows which must go.

    Attributes:
        open: connections at the last look.
        closed: connections that were closed here since the start.
        muted: connections that were muted here since the start.
    """

    def __init__(self, admission: Admission) -> None:
        self._admission = admission
        self.open = 0
        self.closed = 0
        self.muted = 0
        self._limits: dict[str, float] = {}
        """Bytes that a connection may have sent until it is muted, by address."""
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
            closed = sum(sockets.close(address) for address in self._admission.surplus(present))
            muted = sum(sockets.mute(address) for address in self.flooding(sockets, present))
            self.open = len(present) - closed
            self.closed += closed
            self.muted += muted
            if closed or muted:
                self._log(
                    logging.WARNING,
                    f"of connections without an admitted call, {self.closed} were closed since the start, "
                    f"and {self.muted} were muted because they sent too much; {self.open} are open",
                )

    def flooding(self, sockets: AcceptedSockets, present: list[str]) -> list[str]:
        """Returns the pending connections that have sent more than PENDING_BYTES while they were pending."""
        pending = set(self._admission.pending())
        limits: dict[str, float] = {}
        flooding = []
        for address in present:
            if address not in pending:
                limits[address] = _PLACED
                continue
            received, limit = sockets.received_bytes(address), self._limits.get(address, PENDING_BYTES)
            if limit == _PLACED:
                limit = received + PENDING_BYTES
            elif received > limit:
                limit = math.inf
                flooding.append(address)
            limits[address] = limit
        self._limits = limits
        return flooding

    def _log(self, level: int, message: str) -> None:
        """Logs a message, unless there was one lately: attackers must not fill the log."""
        now_s = time.monotonic()
        if now_s - self._logged_s >= _LOG_EVERY_S:
            _log.log(level, "%s", message)
            self._logged_s = now_s
