"""The account of all connections: who may have how many, how many calls each may make, and which must go.

A connection is pending until a call of it is admitted; then it has a place. Only places are limited by the
settings: strangers can't take those of operators. Pending connections are few and short-lived instead.
"""

import math
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final

from common.errors import TooMuchError
from common.reasons import Reason
from common.token_bucket import TokenBucket
from gateway.access.address_prefix import address_prefix, host_of
from gateway.config import LimitSettings
from gateway.rpc.calls.call import Peer
from gateway.rpc.connections.blocklist import Blocklist
from gateway.rpc.connections.packet_filter import ConnectPolicy
from gateway.rpc.connections.shedding import Shedding

QUIET_AFTER_S: Final = 1.0
"""A connection without streams and without calls for this long gives way when room is needed."""
FORGIVEN_AFTER_S: Final = 5.0
"""Without a refusal; until then a connection's bucket hardly fills."""
PENDING_S: Final = 10.0
"""How long a connection may be pending: a TLS handshake and a call over a bad link."""
MAX_PENDING: Final = 128
"""Pending connections, or a quarter of those that are accepted, and half of them from one address."""
NEWCOMER_S: Final = 0.3
"""So long a pending connection is a new one: if it floods, it mostly does so within this time."""
SPARED_S: Final = 1.0
"""So long many of one address may be pending, as where all operators come back after a restart, if there is
room for all."""
NOTICE_S: Final = 1.0
"""So long a connection that has lost its place by a revocation makes no room for others: until its caller has
the reason. One that is cut off before takes it for an outage, and connects again."""
PENDING_STREAMS: Final = 4
"""Of one pending connection, of which the health service is all that it can use."""
METHOD_RATES: Final[Mapping[str, float]] = {
    "RequestKeyFrame": 3.0,
    "ReportPicture": 8.0,
    "ListRecordings": 20.0,
    "GetRecording": 20.0,
    "GetRecordingThumbnail": 20.0,
}
"""Calls a second of methods that reach further than their caller: what one viewer causes, all viewers see;
and the recorder's disk is everyone's. The schema documents them."""
_REDUCED_BURST_S: Final = 0.01
"""The reduced bucket holds what is refilled in this time."""
_RENEWED_EVERY_S: Final = 60.0
"""How often an address is trusted anew while a connection from there has a place."""
_RETRY_AFTER_S: Final = 1.0
"""Suggested to a caller for whom there is no connection left."""


@dataclass(slots=True)
class _Connection:
    address_prefix: str
    bucket: TokenBucket
    pending_since_s: float
    admitted: bool = False
    caller: str = ""
    credential_ids: tuple[str, ...] = ()
    floods: bool = False
    unused: bool = False
    streams: int = 0
    revoked_s: float = -math.inf
    refused_s: float = -math.inf
    excess_s: float = -math.inf
    method_buckets: dict[str, TokenBucket] = field(default_factory=dict)


class Admission:
    """The account of all TCP connections; a Unix socket's are not limited. Pure; used on one event loop.

    Args:
        limits: what a connection may have, and how many there may be.
        clock: seconds, monotonic.
        max_connections: accepted at once, pending ones included.
    """

    def __init__(
        self,
        limits: LimitSettings,
        clock: Callable[[], float] = time.monotonic,
        *,
        max_connections: int = 4 * MAX_PENDING,
    ) -> None:
        self._limits = limits
        self._max_pending = min(MAX_PENDING, max_connections // 4)
        self._clock = clock
        self._blocklist = Blocklist(clock)
        self._shedding = Shedding(clock)
        self._renewed_s = clock()
        self._connections: dict[str, _Connection] = {}
        """By `Peer.address`, the one that called last at the end."""
        self._places: Counter[str] = Counter()
        """Taken, by address prefix."""
        self._places_of_callers: Counter[str] = Counter()
        """The same by name, where callers have one."""

    def take_token(self, peer: Peer, method: str = "") -> None:
        """Takes one token out of the connection's bucket, and of the method's if it has a rate of its own.

        Raises:
            TooMuchError: a bucket is empty.
        """
        if peer.ip is None:
            return
        limits, now_s = self._limits, self._clock()
        connection = self._connections.pop(peer.address, None)
        if connection is None:
            connection = self._new(peer.address_prefix, now_s)
        self._connections[peer.address] = connection
        bucket, capacity = connection.bucket, self._capacity(connection, now_s)
        if bucket.take(now_s, capacity=capacity, refill_per_s=limits.requests_per_s):
            if rate := METHOD_RATES.get(method):
                self._take_method_token(connection, method, rate, now_s)
            return
        connection.refused_s = now_s
        raise TooMuchError(
            f"this connection makes more than {limits.requests_per_s:g} requests a second; call less often",
            Reason.TOO_MANY_REQUESTS,
            (1 - bucket.tokens) / limits.requests_per_s,
        )

    def _take_method_token(
        self, connection: _Connection, method: str, rate_per_s: float, now_s: float
    ) -> None:
        bucket = connection.method_buckets.setdefault(method, TokenBucket(rate_per_s, now_s))
        if not bucket.take(now_s, capacity=rate_per_s, refill_per_s=rate_per_s):
            raise TooMuchError(
                f"this connection calls {method} more than {rate_per_s:g} times a second; call it less often",
                Reason.TOO_MANY_REQUESTS,
                (1 - bucket.tokens) / rate_per_s,
            )

    def open_stream(self, peer: Peer) -> None:
        """Counts one more stream of the connection, after `take_token`.

        Raises:
            TooMuchError: it has as many as allowed.
        """
        connection = self._connections.get(peer.address)
        if connection is None:
            return
        most = self._limits.streams_per_connection
        if connection.streams >= (most if connection.admitted else min(most, PENDING_STREAMS)):
            raise TooMuchError(
                f"this connection has {connection.streams} streams open, and no more are allowed; "
                "close one, or share it",
                Reason.TOO_MANY_STREAMS,
            )
        connection.streams += 1

    def close_stream(self, peer: Peer) -> None:
        """Counts one stream less, unless the connection has gone already."""
        connection = self._connections.get(peer.address)
        if connection is not None:
            connection.streams -= 1

    def admit(self, peer: Peer, caller: str = "", credential_ids: tuple[str, ...] = ()) -> None:
        """Gives the connection a place, after a valid credential was shown or where none is needed.

        Args:
            peer: the other end.
            caller: the name on the credential; empty where none is needed.
            credential_ids: of what was shown.

        Raises:
            TooMuchError: all places are taken.
        """
        connection = self._connections.get(peer.address)
        if connection is None:
            return
        connection.credential_ids = credential_ids
        if connection.admitted:
            return
        limits, prefix = self._limits, peer.address_prefix
        taken = self._places_of_callers[caller] if caller else 0
        if taken >= limits.connections_per_caller and not self._evict(caller=caller):
            raise TooMuchError(
                f"this gateway serves {limits.connections_per_caller} connections of {caller} at once, "
                "and all are taken; close one, or raise limits.connections_per_caller",
                Reason.TOO_MANY_CONNECTIONS,
                _RETRY_AFTER_S,
            )
        if self._places[prefix] >= limits.connections_per_address and not self._evict(prefix=prefix):
            raise TooMuchError(
                f"this gateway serves {limits.connections_per_address} connections of one address at once, "
                "and yours are taken; close one, or raise limits.connections_per_address",
                Reason.TOO_MANY_CONNECTIONS,
                _RETRY_AFTER_S,
            )
        if self._places.total() >= limits.connections and not self._evict():
            raise TooMuchError(
                f"this gateway serves {limits.connections} connections at once, and all are taken; "
                "close one, or raise limits.connections",
                Reason.TOO_MANY_CONNECTIONS,
                _RETRY_AFTER_S,
            )
        connection.admitted, connection.caller = True, caller
        self._places[prefix] += 1
        if caller:
            self._places_of_callers[caller] += 1
        self._blocklist.note_admitted(prefix)

    def is_pending(self, peer: Peer) -> bool:
        """Returns whether the connection has no place and needs one; also if it is not known yet."""
        connection = self._connections.get(peer.address)
        return peer.ip is not None if connection is None else not connection.admitted

    def note_excess(self, peer: Peer) -> None:
        """Takes down that so many calls of the connection are refused that they can't be delayed any more."""
        connection = self._connections.get(peer.address)
        if connection is not None:
            connection.excess_s = self._clock()

    def is_restrained(self, peer: Peer) -> bool:
        """Returns whether calls of the connection take turns: it is pending, or was in excess lately."""
        connection = self._connections.get(peer.address)
        if connection is None or not connection.admitted:
            return self.is_pending(peer)
        return self._clock() - connection.excess_s < FORGIVEN_AFTER_S

    def dismiss(self, peer: Peer) -> None:
        """Takes the connection's place away, after a credential was invalid."""
        connection = self._connections.get(peer.address)
        if connection is not None:
            self._free_place(connection)

    def dismiss_callers(
        self, lost: Collection[tuple[str, ...]], others: Mapping[str, tuple[str, ...]]
    ) -> None:
        """Takes the places of connections away whose newest caller has lost access, before it calls again.

        Args:
            lost: `credential_ids` that have become invalid.
            others: `credential_ids` of a valid caller with an open stream, by `Peer.address`. The place is
                its from now on.
        """
        for address, each in self._connections.items():
            if each.credential_ids not in lost:
                continue
            if address in others:
                each.credential_ids = others[address]
            elif each.admitted:
                each.revoked_s = self._clock()
                self._free_place(each)

    def surplus(self, present: Iterable[str]) -> list[str]:
        """Returns the connections to close: pending ones, after PENDING_S or where there are too many.

        An address with more of them than others loses them first, and of one address the oldest go: a caller
        with a credential needs no more than a moment.

        Args:
            present: addresses of all connections there are, as `Peer.address` has them.
        """
        now_s, present = self._clock(), set(present)
        for address in self._connections.keys() - present:
            gone = self._connections.pop(address)
            if not gone.admitted:
                self._note_unused(gone)
            self._free_place(gone)
        for address in present - self._connections.keys():
            self._connections[address] = self._new(_prefix_of(address), now_s)
        self._renew_trust(now_s)
        self._shedding.adapt()
        surplus = self._beyond_limits(now_s)
        for address in surplus:
            self._note_unused(self._connections[address])
        return surplus

    def _renew_trust(self, now_s: float) -> None:
        """Trusts addresses for as long as they have places, and TRUSTED_S from then on."""
        if now_s - self._renewed_s < _RENEWED_EVERY_S:
            return
        self._renewed_s = now_s
        for prefix in self._places:
            self._blocklist.note_admitted(prefix)

    def _beyond_limits(self, now_s: float) -> list[str]:
        """Returns the pending connections that are too old or too many."""
        pending = [
            (each, address)
            for address, each in self._connections.items()
            if not each.admitted and now_s - each.revoked_s > NOTICE_S
        ]
        pending.sort(key=lambda item: item[0].pending_since_s, reverse=True)
        newer: Counter[str] = Counter()
        ranked = []
        for each, address in pending:
            ranked.append((newer[each.address_prefix], now_s - each.pending_since_s, address))
            newer[each.address_prefix] += 1
        ranked.sort()
        return [
            address
            for kept, (rank, age_s, address) in enumerate(ranked)
            if age_s > PENDING_S
            or kept >= self._max_pending
            or (rank >= self._max_pending // 2 and age_s > SPARED_S)
        ]

    def _note_unused(self, connection: _Connection) -> None:
        """Takes down once that a connection is of no use."""
        if not connection.unused:
            connection.unused = True
            self._blocklist.note_unused(connection.address_prefix, strict=self._shedding.active)

    def pending(self) -> list[str]:
        """Returns the addresses of the connections that have no place."""
        return [address for address, each in self._connections.items() if not each.admitted]

    def pending_of_blocked(self) -> list[str]:
        """Returns the addresses of the pending connections whose address prefix is blocked."""
        blocked = self._blocklist.blocked()
        return [
            address
            for address, each in self._connections.items()
            if not each.admitted and each.address_prefix in blocked
        ]

    def note_flood(self, address: str) -> None:
        """Takes down that the connection of this `Peer.address` calls or sends too much."""
        self._blocklist.note_flood(_prefix_of(address))
        connection = self._connections.get(address)
        if connection is not None:
            connection.floods = True

    def floods(self, address: str) -> bool:
        """Returns whether `note_flood` was called for the connection of this `Peer.address`."""
        connection = self._connections.get(address)
        return connection is not None and connection.floods

    @property
    def overrun(self) -> bool:
        """Whether strangers connect faster than the gateway can take, or did so a moment ago."""
        return self._shedding.active

    def has_newcomers(self) -> bool:
        """Returns whether a connection has been pending for NEWCOMER_S at the most, a new one or not."""
        since_s = self._clock() - NEWCOMER_S
        return any(
            not each.admitted and each.pending_since_s > since_s for each in self._connections.values()
        )

    def connect_policy(self) -> ConnectPolicy:
        """Returns from whom further connections are to be accepted now. Called after `surplus`."""
        blocked, one_in = self._blocklist.blocked(), self._shedding.one_in
        return ConnectPolicy(blocked, one_in, self._blocklist.trusted() if one_in > 1 else frozenset())

    def _new(self, prefix: str, now_s: float) -> _Connection:
        if not self._blocklist.is_trusted(prefix):
            self._shedding.note_stranger()
        return _Connection(prefix, TokenBucket(self._limits.burst, now_s), now_s)

    def _capacity(self, connection: _Connection, now_s: float) -> float:
        """Reduced after a refusal: a full bucket would only be emptied at once again."""
        limits = self._limits
        if now_s - connection.refused_s >= FORGIVEN_AFTER_S:
            return limits.burst
        return max(1.0, min(limits.burst, limits.requests_per_s * _REDUCED_BURST_S))

    def _evict(self, *, prefix: str = "", caller: str = "") -> bool:
        """Frees the place of the quietest connection, of these or of all; returns False if none is quiet."""
        now_s = self._clock()
        for each in self._connections.values():
            quiet = each.admitted and not each.streams and now_s - each.bucket.updated_s >= QUIET_AFTER_S
            if quiet and prefix in ("", each.address_prefix) and caller in ("", each.caller):
                self._free_place(each)
                return True
        return False

    def _free_place(self, connection: _Connection) -> None:
        if connection.admitted:
            connection.admitted, connection.pending_since_s = False, self._clock()
            self._places[connection.address_prefix] -= 1
            if not self._places[connection.address_prefix]:
                del self._places[connection.address_prefix]
            if connection.caller:
                self._places_of_callers[connection.caller] -= 1
                if not self._places_of_callers[connection.caller]:
                    del self._places_of_callers[connection.caller]


def _prefix_of(address: str) -> str:
    """Returns the prefix of a `Peer.address`."""
    return address_prefix(host_of(address))
