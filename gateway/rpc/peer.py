"""Where a call came from, by gRPC's peer strings: "ipv4:10.0.0.5:41234" for example."""

from functools import lru_cache
from typing import Final
from urllib.parse import unquote

_LOCAL_SOCKET: Final = "local socket"
_REMEMBERED_CONNECTIONS: Final = 256


@lru_cache(maxsize=_REMEMBERED_CONNECTIONS)
def address_of(peer: str) -> str:
    """For people: address and port of a connection, "local socket" for a Unix one."""
    scheme, _, rest = unquote(peer).partition(":")
    return rest if scheme in {"ipv4", "ipv6"} else _LOCAL_SOCKET


def host_of(peer: str) -> str:
    """The same without its port."""
    address = address_of(peer)
    return address.rpartition(":")[0].strip("[]") or address


def ip_of(peer: str) -> str | None:
    """The IP address, IPv4 as such also where IPv6 carries it; None for a Unix socket."""
    host = host_of(peer)
    if host == _LOCAL_SOCKET:
        return None
    return host.removeprefix("::ffff:") if "." in host else host
