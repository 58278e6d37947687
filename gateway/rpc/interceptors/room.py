"""Room for stops among the calls that are served at once."""

from typing import Final

from common.errors import TooMuchError
from common.interceptors import Interceptor
from common.reasons import Reason
from gateway.rpc.calls.call import CallContext

MAX_OPEN: Final = 4096
"""Calls of all connections, streams and those that wait among them. gRPC itself accepts more
(gateway/rpc/server.py), because what it refuses has no name yet, a stop neither."""
_RETRY_AFTER_S: Final = 1.0


class Room(Interceptor[CallContext]):
    """Refuses any further call but a stop when all of the gateway is taken."""

    def __init__(self) -> None:
        self._open = 0

    def on_call(self, call: CallContext) -> None:
        """Counts an open call.

        Raises:
            TooMuchError: there are too many.
        """
        if self._open >= MAX_OPEN and not call.unlimited:
            raise TooMuchError(
                f"this gateway serves {MAX_OPEN} calls at once, and as many are open; try again later",
                Reason.TOO_MANY_REQUESTS,
                _RETRY_AFTER_S,
            )
        self._open += 1

    def on_end(self, _call: CallContext, _error: BaseException | None) -> None:
        """Counts one less."""
        self._open -= 1
