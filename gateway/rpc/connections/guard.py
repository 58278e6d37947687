"""Closes connections that take room without making calls that are admitted."""

import asyncio
import logging
import time
from typing import Final, NoReturn

from gateway.rpc.connections.accepted_sockets import AcceptedSockets
from gateway.rpc.connections.admission import Admission

_log = logging.getLogger(__name__)

SCAN_EVERY_S: Final = 0.1
"""What is accepted in between is bounded by the server's limit of connections."""
_LOG_EVERY_S: Final = 10.0


class ConnectionGuard:
    """Looks at the connections that there are, ten times a second.

    Args:
        admission: knows which must go.

    Attributes:
        open: connections at the last look.
        closed: connections that were closed here since the start.
    """

    def __init__(self, admission: Admission) -> None:
        self._admission = admission
        self.open = 0
        self.closed = 0

    async def run(self, port: int) -> NoReturn:
        """Guards the operators' port until cancelled."""
        sockets = AcceptedSockets(port)
        logged_s, logged = time.monotonic(), 0
        while True:
            await asyncio.sleep(SCAN_EVERY_S)
            try:
                present = sockets.scan()
            except OSError as error:
                # No descriptors are left; the server's limit keeps connections from being the cause.
                if time.monotonic() - logged_s >= _LOG_EVERY_S:
                    _log.error("connections can't be examined: %s", error)
                    logged_s = time.monotonic()
                continue
            closed = sum(sockets.close(address) for address in self._admission.surplus(present))
            self.open = len(present) - closed
            self.closed += closed
            if self.closed > logged and time.monotonic() - logged_s >= _LOG_EVERY_S:
                _log.warning(
                    "%d connections without an admitted call were closed lately, %d are open",
                    self.closed - logged,
                    self.open,
                )
                logged_s, logged = time.monotonic(), self.closed
