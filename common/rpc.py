"""gRPC servers as every program of the project makes them: the same limits, keepalive and error statuses.

common.bind binds what `new_server` returns to a TCP port or a Unix socket.
"""

import resource
from typing import Final

import grpc

from common.grpc_errors import ErrorInterceptor
from common.interceptors import Chain

STOP_GRACE_S: Final = 0.5
"""How long a server lets running calls finish when it stops."""

_SERVER_OPTIONS: Final = (
    # A second program on the same port is an error, never half of the calls.
    ("grpc.so_reuseport", 0),
    # Requests are small: a larger one is rejected before it takes memory.
    ("grpc.max_receive_message_length", 256 * 1024),
    ("grpc.max_send_message_length", 4 * 1024 * 1024),
    # Per connection (SETTINGS_MAX_CONCURRENT_STREAMS, RFC 9113 6.5.2): what one client can have handled at
    # once, before those of others.
    ("grpc.max_concurrent_streams", 256),
    # Calls of all connections that wait for a handler; gRPC cancels any more, of any caller. Each takes some
    # 20 KiB and 0.1 ms, so a long queue costs memory, and the others more time, than a short one saves calls.
    ("grpc.server.max_pending_requests", 1024),
    ("grpc.server.max_pending_requests_hard_limit", 2048),
    # From the connection to the HTTP/2 preface.
    ("grpc.server_handshake_timeout_ms", 5_000),
    # A peer that vanished is noticed after 5 + 3 s.
    ("grpc.keepalive_time_ms", 5_000),
    ("grpc.keepalive_timeout_ms", 3_000),
    # Without this one gRPC 1.85 waits 60 s for any ping's answer, keepalive or not.
    ("grpc.http2.ping_timeout_ms", 3_000),
    ("grpc.keepalive_permit_without_calls", 1),
    # Clients may ping more often themselves (ours every 2 s) without GOAWAY "too_many_pings".
    ("grpc.http2.min_ping_interval_without_data_ms", 1_000),
    # A connection without calls is closed; gRPC clients connect again for their next one.
    ("grpc.max_connection_idle_ms", 300_000),
)
_MAX_CONNECTIONS: Final = 1024
_MAX_CONCURRENT_CALLS: Final = 4096
"""Of all connections; more are refused with RESOURCE_EXHAUSTED. Beyond its own limit a connection's streams
are reset by HTTP/2, which a flooding caller may see as UNAVAILABLE."""


def possible_connections(wanted: int, addresses: int = 1) -> int:
    """Returns how many connections to accept at once: all together at most half of the possible descriptors.

    Each takes some 45 to 100 KiB with TLS besides, whatever it does. The other half is for files: none has to
    be kept spare for reading the list of credentials.

    Args:
        wanted: at each address.
        addresses: that the server listens at; each accepts as many.
    """
    descriptors, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return wanted if descriptors == resource.RLIM_INFINITY else min(wanted, descriptors // 2 // addresses)


def new_server(
    chain: Chain | None = None,
    *,
    max_connections: int = _MAX_CONNECTIONS,
    max_calls: int = _MAX_CONCURRENT_CALLS,
) -> grpc.aio.Server:
    """Returns a server that is neither bound nor started.

    Args:
        chain: what every call passes; by default an ErrorInterceptor alone.
        max_connections: accepted at once at each of its addresses; any more are closed before TLS.
            No more than `possible_connections`.
        max_calls: served at once; any more are refused before the chain.
    """
    at_most = ("grpc.max_allowed_incoming_connections", possible_connections(max_connections))
    return grpc.aio.server(
        interceptors=(chain or Chain([ErrorInterceptor()]),),
        options=(*_SERVER_OPTIONS, at_most),
        maximum_concurrent_rpcs=max_calls,
    )
