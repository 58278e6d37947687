"""Limits of each connection: requests a second, open streams, and how many connections there may be.

Requests are limited by a token bucket per connection. gRPC's Python API does not report connections that
come and go, so a connection counts while it has a stream open or has called lately; the quietest gives way
to a new one.

To refuse costs nearly as much as to answer: a client that repeats a refused call at once would still take
the time of all others. So refusals are delayed and spaced, and a client that floods is slowed down by its
own open calls.
"""

import asyncio
import math
import time
from collections import Counter
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any, Final

from common.errors import TooMuchError
from common.interceptors import Interceptor
from common.reasons import Reason
from common.token_bucket import TokenBucket
from gateway.config import LimitSettings
from gateway.rpc.calls.call import CallContext, Peer

QUIET_AFTER_S: Final = 1.0
"""A connection without streams and without calls for this long gives way when room is needed."""
REFUSAL_DELAY_S: Final = 0.5
"""Minimum delay of a refusal."""
REFUSAL_SPACING_S: Final = 0.005
"""Minimum spacing of delayed refusals, over all connections."""
FORGIVEN_AFTER_S: Final = 5.0
"""Without a refusal; until then a connection's bucket hardly fills."""
_REDUCED_BURST_S: Final = 0.01
"""The reduced bucket holds what is refilled in this time."""
_MAX_DELAYED: Final = 1024
"""Refusals that are delayed at once, the last of them for five seconds; any more leave at once, because
each one that waits takes memory."""
_RETRY_AFTER_S: Final = 1.0
"""Suggested to a caller for whom there is no connection left."""


@dataclass(slots=True)
class _Connection:
    address_prefix: str
    bucket: TokenBucket
    streams: int = 0
    refused_s: float = -math.inf


class RateLimit(Interceptor[CallContext]):
    """Refuses calls beyond a connection's share with a delay; accounts for open streams.

    Each message of a request stream takes a token like a call.
    """

    def __init__(self, admission: "Admission") -> None:
        self._admission = admission
        self._delayed = 0

    def on_call(self, call: CallContext) -> Awaitable[None] | None:
        """Takes a token, and a stream if the call is one.

        Raises:
            TooMuchError: there is none left; mostly from the awaitable, after a delay.
        """
        try:
            self._admission.take_token(call.peer)
            if call.method.streaming:
                self._admission.open_stream(call.peer)
        except TooMuchError as error:
            if self._delayed >= _MAX_DELAYED:
                raise
            return self._refuse_later(error)
        return None

    def on_request(self, call: CallContext, request: Any) -> Any:
        """Takes a token for a message of a request stream.

        Raises:
            TooMuchError: there is none left. It ends the stream at once; opening another one is delayed.
        """
        if call.method.request_streaming:
            self._admission.take_token(call.peer)
        return request

    def on_end(self, call: CallContext, _error: BaseException | None) -> None:
        """Gives the stream back."""
        if call.method.streaming:
            self._admission.close_stream(call.peer)

    async def _refuse_later(self, error: TooMuchError) -> None:
        self._delayed += 1
        try:
            await asyncio.sleep(self._admission.refusal_delay_s())
        finally:
            self._delayed -= 1
        try:
            raise error
        finally:
            # Its traceback has this frame: a reference from here would keep both until the next collection.
            del error


class Admission:
    """The account of all connections. Pure; used on one event loop.

    Args:
        limits: what a connection may have, and how many there may be.
        clock: seconds, monotonic.
    """

    def __init__(self, limits: LimitSettings, clock: Callable[[], float] = time.monotonic) -> None:
        self._limits = limits
        self._clock = clock
        self._connections: dict[str, _Connection] = {}
        """By gRPC's name of the connection, the one that called last at the end."""
        self._per_prefix: Counter[str] = Counter()
        self._last_refusal_s = 0.0
        """When the last one of the delayed refusals leaves."""

    def take_token(self, peer: Peer) -> None:
        """Takes one token out of the connection's bucket.

        Raises:
            TooMuchError: the bucket is empty, or there is no room for another connection.
        """
        limits, now_s = self._limits, self._clock()
        connection = self._connections.pop(peer.connection, None) or self._new(peer, now_s)
        self._connections[peer.connection] = connection
        bucket, capacity = connection.bucket, self._capacity(connection, now_s)
        if bucket.take(now_s, capacity=capacity, refill_per_s=limits.requests_per_s):
            return
        connection.refused_s = now_s
        raise TooMuchError(
            f"this connection makes more than {limits.requests_per_s:g} requests a second; call less often",
            Reason.TOO_MANY_REQUESTS,
            (1 - bucket.tokens) / limits.requests_per_s,
        )

    def open_stream(self, peer: Peer) -> None:
        """Counts one more stream of the connection, after `take_token`.

        Raises:
            TooMuchError: it has as many as allowed.
        """
        connection = self._connections[peer.connection]
        if connection.streams >= self._limits.streams_per_connection:
            raise TooMuchError(
                f"this connection has {connection.streams} streams open, and no more are allowed; "
                "close one, or share it",
                Reason.TOO_MANY_STREAMS,
            )
        connection.streams += 1

    def close_stream(self, peer: Peer) -> None:
        """Counts one stream less. A connection with a stream is never evicted, so it is there."""
        self._connections[peer.connection].streams -= 1

    def refusal_delay_s(self) -> float:
        """Returns how long the next refusal waits: a minimum, and behind those that wait already."""
        now_s = self._clock()
        self._last_refusal_s = max(now_s + REFUSAL_DELAY_S, self._last_refusal_s + REFUSAL_SPACING_S)
        return self._last_refusal_s - now_s

    def _capacity(self, connection: _Connection, now_s: float) -> float:
        """Reduced after a refusal: a full bucket would only be emptied at once again."""
        limits = self._limits
        if now_s - connection.refused_s >= FORGIVEN_AFTER_S:
            return limits.burst
        return max(1.0, min(limits.burst, limits.requests_per_s * _REDUCED_BURST_S))

    def _new(self, peer: Peer, now_s: float) -> _Connection:
        limits = self._limits
        if self._per_prefix[peer.address_prefix] >= limits.connections_per_address and not self._evict(
            now_s, peer.address_prefix
        ):
            raise TooMuchError(
                f"this gateway serves {limits.connections_per_address} connections of one address at once, "
                "and yours are taken; close one, or raise limits.connections_per_address",
                Reason.TOO_MANY_CONNECTIONS,
                _RETRY_AFTER_S,
            )
        if len(self._connections) >= limits.connections and not self._evict(now_s):
            raise TooMuchError(
                f"this gateway serves {limits.connections} connections at once, and all are taken; "
                "close one, or raise limits.connections",
                Reason.TOO_MANY_CONNECTIONS,
                _RETRY_AFTER_S,
            )
        self._per_prefix[peer.address_prefix] += 1
        return _Connection(peer.address_prefix, TokenBucket(limits.burst, now_s))

    def _evict(self, now_s: float, prefix: str | None = None) -> bool:
        """Forgets the quietest connection, of this prefix or of all; False when none is quiet enough."""
        for connection, each in self._connections.items():
            quiet = each.streams == 0 and now_s - each.bucket.updated_s >= QUIET_AFTER_S
            if quiet and prefix in (None, each.address_prefix):
                del self._connections[connection]
                self._per_prefix[each.address_prefix] -= 1
                if not self._per_prefix[each.address_prefix]:
                    del self._per_prefix[each.address_prefix]
                return True
        return False
