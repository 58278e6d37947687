"""A client's deadlines, retries and keepalive."""

import math
from dataclasses import dataclass, field

from common import backoff

_MS_PER_S = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Backoff:
    """Settings of the exponential backoff between attempts."""

    first_s: float = 0.1
    factor: float = 2.0
    longest_s: float = 0.4
    give_up_after_s: float = 1.0
    """No attempt begins later than this after the first one."""

    def start(self) -> backoff.Backoff:
        """Returns the pauses, beginning with the first."""
        return backoff.Backoff(self.first_s, self.longest_s, self.factor)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClientOptions:
    """Deadlines, retries and keepalive. By default an absent robot is reported after about 2 s."""

    answer_within_s: float = 2.0
    """Deadline of a status or overlay call, retries included. The gateway answers from memory."""
    preview_within_s: float = 8.0
    """Deadline of a preview call: the robot may wait for the pipeline before it answers."""
    recording_within_s: float = 15.0
    """Deadline of a call about recordings: a stop waits up to 10 s for the robot's disk."""
    settle_poll_s: float = 0.1
    """Polling interval of a preview that is starting or stopping."""
    connect_within_s: float = 1.0
    """Deadline of one connection attempt. Name resolution has the same deadline on top."""
    backoff: Backoff = field(default_factory=Backoff)
    stream_backoff: Backoff = field(default_factory=lambda: Backoff(longest_s=2.0, give_up_after_s=math.inf))
    """Pauses between the connections of a stream, which reconnects for as long as it is read."""
    keepalive_every_s: float = 2.0
    """Interval of pings on a silent connection."""
    metadata: tuple[tuple[str, str], ...] = ()
    """Sent with every call, beside the credentials."""
    keepalive_within_s: float = 2.0
    """Deadline of a ping's answer. A half-dead link is noticed after the sum of both at the latest."""

    def channel_options(self) -> list[tuple[str, int]]:
        """Returns the same as gRPC channel arguments, which count in ms."""
        connect_ms = round(self.connect_within_s * _MS_PER_S)
        return [
            # The shortest pause between attempts is also how long gRPC lets one attempt take.
            ("grpc.initial_reconnect_backoff_ms", round(self.backoff.first_s * _MS_PER_S)),
            ("grpc.min_reconnect_backoff_ms", connect_ms),
            ("grpc.max_reconnect_backoff_ms", connect_ms),
            ("grpc.dns_ares_query_timeout", connect_ms),
            ("grpc.keepalive_time_ms", round(self.keepalive_every_s * _MS_PER_S)),
            ("grpc.keepalive_timeout_ms", round(self.keepalive_within_s * _MS_PER_S)),
            # Without this one gRPC 1.85 waits 60 s for any ping's answer, keepalive or not.
            ("grpc.http2.ping_timeout_ms", round(self.keepalive_within_s * _MS_PER_S)),
            # Between calls, too: the next call then finds a new connection instead of a dead one.
            ("grpc.keepalive_permit_without_calls", 1),
            ("grpc.http2.max_pings_without_data", 0),
            # A robot is never behind the office's web proxy.
            ("grpc.enable_http_proxy", 0),
            # Clients share nothing: closing one never affects another.
            ("grpc.use_local_subchannel_pool", 1),
        ]
