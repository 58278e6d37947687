"""`grpc`, `limits`, `discovery`: where the gateway serves, and how much it serves to one caller."""

import ipaddress

from pydantic import Field, field_validator

from common.config import Section
from common.listen_host import ListenHost
from common.socket_path import SocketPath


class GrpcSettings(Section):
    """The address for operators."""

    host: ListenHost = "127.0.0.1"
    port: int = Field(default=50051, ge=0, le=65535)
    """0 takes any free port, which the log names."""
    socket: SocketPath | None = None
    """Additional Unix socket for health checks on this machine. Unencrypted; methods other than those of the
    health service require a credential there, too."""


class LimitSettings(Section):
    """Limits per caller; requests beyond them are refused with RESOURCE_EXHAUSTED."""

    connections: int = Field(default=256, ge=1, le=10_000)
    """Connections served at once."""
    connections_per_address: int = Field(default=128, ge=1, le=10_000)
    """How many of them may come from one address, so that one computer can't take them all."""
    connections_per_caller: int = Field(default=32, ge=1, le=10_000)
    """How many of them one name on credentials may have, wherever they come from."""
    streams_per_connection: int = Field(default=16, ge=1, le=1000)
    requests_per_s: float = Field(default=500.0, gt=0)
    """Refill rate of each connection's token bucket."""
    burst: int = Field(default=1000, ge=1)
    """Capacity of the bucket, in requests."""
    caller_requests_per_s: float = Field(default=1000.0, gt=0)
    """Refill rate of each caller's token bucket, which all of its connections share; it holds twice as many.
    A caller is a name on credentials, or an address where none is needed."""
    caller_streams: int = Field(default=256, ge=1, le=4096)
    """Streams that a caller may have open, over all of its connections."""
    request_bytes: int = Field(default=131_072, ge=1024, le=262_144)
    """Largest request that is accepted."""


class DiscoverySettings(Section):
    """Whether and where the gateway is announced by mDNS, so that operators find it without its address."""

    advertise: bool = False
    addresses: tuple[str, ...] = ()
    """Of this machine: on whose networks it is announced; by default the network of the default route."""

    @field_validator("addresses")
    @classmethod
    def _are_addresses(cls, addresses: tuple[str, ...]) -> tuple[str, ...]:
        for each in addresses:
            try:
                ipaddress.ip_address(each)
            except ValueError:
                raise ValueError("addresses of this machine, [10.0.0.7] for example") from None
        return addresses
