"""Each connection's share: how many there may be, how many streams each, how often each may ask. Pure.

A connection's requests are tokens: it has up to `burst` of them, gets `requests_per_s` new ones, and spends
one per call. gRPC tells nobody here of connections that come and go, so one counts while it has a stream open
or has asked lately; the quietest gives way to a new one. One computer may have a part of them only.
"""

import math
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from common.errors import TooMuchError
from common.reasons import Reason
from gateway.access.address_prefix import address_prefix
from gateway.rpc.peer import host_of

QUIET_AFTER_S: Final = 1.0
"""A connection without streams that has not asked for so long gives way when room is needed."""
MOST_REQUEST_BYTES: Final = 128 * 1024
"""Far more than any request of the contract has; gRPC itself takes twice as much."""
PENALTY_S: Final = 0.5
"""A refusal comes so late at least."""
REFUSE_EVERY_S: Final = 0.005
"""And so long after the one before, whoever that went to."""
FORGIVEN_AFTER_S: Final = 5.0
"""Without a refusal. Until then a connection may not ask in bursts."""
_HARDLY_ANYTHING_S: Final = 0.01
"""What is saved up in this time."""
_SOON_S: Final = 1.0
"""When to try again where nobody knows when there will be room."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What a connection may have, and how many there may be."""

    connections: int = 256
    connections_per_address: int = 128
    streams_per_connection: int = 16
    requests_per_s: float = 500.0
    burst: int = 1000
    request_bytes: int = MOST_REQUEST_BYTES


@dataclass(slots=True)
class _Connection:
    site: str
    tokens: float
    at_s: float
    streams: int = 0
    refused_s: float = -math.inf
    """When it was refused last."""


class Admission:
    """Belongs to one event loop.

    Args:
        limits: what is allowed.
        clock: seconds, monotonic.
    """

    def __init__(self, limits: Limits, clock: Callable[[], float] = time.monotonic) -> None:
        self._limits = limits
        self._clock = clock
        self._connections: dict[str, _Connection] = {}
        """By peer, the one that asked last at the end."""
        self._sites: Counter[str] = Counter()
        """How many of them come from where."""
        self._refusal_at_s = 0.0
        """When the last refusal that waits will leave."""

    @property
    def connection_count(self) -> int:
        """How many are remembered."""
        return len(self._connections)

    def request(self, peer: str) -> None:
        """One call of this connection begins.

        Raises:
            TooMuchError: it may not; try again later.
        """
        limits, now_s = self._limits, self._clock()
        connection = self._connections.pop(peer, None) or self._new(peer, now_s)
        self._connections[peer] = connection
        most = self._most_saved(connection, now_s)
        tokens = min(most, connection.tokens + (now_s - connection.at_s) * limits.requests_per_s)
        connection.at_s = now_s
        if tokens >= 1:
            connection.tokens = tokens - 1
            return
        connection.tokens = tokens
        connection.refused_s = now_s
        raise TooMuchError(
            f"this connection asks more than {limits.requests_per_s:g} times a second; ask less often",
            Reason.TOO_MANY_REQUESTS,
            (1 - tokens) / limits.requests_per_s,
        )

    def open_stream(self, peer: str) -> Callable[[], None]:
        """This connection has one more stream open, until what is returned is called; after `request`.

        Raises:
            TooMuchError: it has as many as it may have.
        """
        connection = self._connections[peer]
        if connection.streams >= self._limits.streams_per_connection:
            raise TooMuchError(
                f"this connection has {connection.streams} streams open, and no more are allowed; "
                "close one, or share it",
                Reason.TOO_MANY_STREAMS,
            )
        connection.streams += 1

        def close() -> None:
            connection.streams -= 1

        return close

    def refusal_in_s(self) -> float:
        """How long the next refusal has to wait: a while, and in line behind those that wait already."""
        now_s = self._clock()
        self._refusal_at_s = max(now_s + PENALTY_S, self._refusal_at_s + REFUSE_EVERY_S)
        return self._refusal_at_s - now_s

    def _most_saved(self, connection: _Connection, now_s: float) -> float:
        """Who was refused lately saves up hardly anything: it would only spend it all at once again."""
        limits = self._limits
        if now_s - connection.refused_s >= FORGIVEN_AFTER_S:
            return limits.burst
        return max(1.0, min(limits.burst, limits.requests_per_s * _HARDLY_ANYTHING_S))

    def _new(self, peer: str, now_s: float) -> _Connection:
        limits, site = self._limits, address_prefix(host_of(peer))
        if self._sites[site] >= limits.connections_per_address and not self._put_out(now_s, site):
            raise TooMuchError(
                f"this gateway serves {limits.connections_per_address} connections of one address at once, "
                "and yours are taken; close one, or raise limits.connections_per_address",
                Reason.TOO_MANY_CONNECTIONS,
                _SOON_S,
            )
        if len(self._connections) >= limits.connections and not self._put_out(now_s):
            raise TooMuchError(
                f"this gateway serves {limits.connections} connections at once, and all are taken; "
                "close one, or raise limits.connections",
                Reason.TOO_MANY_CONNECTIONS,
                _SOON_S,
            )
        self._sites[site] += 1
        return _Connection(site, limits.burst, now_s)

    def _put_out(self, now_s: float, site: str | None = None) -> bool:
        """Forgets the quietest connection, of this site or of all; False when none is quiet enough."""
        for peer, each in self._connections.items():
            if site in (None, each.site) and each.streams == 0 and now_s - each.at_s >= QUIET_AFTER_S:
                del self._connections[peer]
                self._sites[each.site] -= 1
                if not self._sites[each.site]:
                    del self._sites[each.site]
                return True
        return False
