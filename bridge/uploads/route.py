"""Through which network interface the store is reached; IPv4 and IPv6, on Linux."""

import asyncio
import fcntl
import ipaddress
import socket
import struct
from contextlib import suppress
from pathlib import Path
from typing import Final

_SIOCGIFADDR: Final = 0x8915
"""netdevice(7)."""
_IF_INET6: Final = Path("/proc/net/if_inet6")
_DISCARD_PORT: Final = 9
"""RFC 863; no packet is sent."""
_RESOLVE_S: Final = 5.0


async def interface_to(host: str) -> str:
    """Returns the name of the interface; empty if there is no route, or the name can't be resolved.

    Args:
        host: HOST or HOST:PORT.
    """
    name = host.partition(":")[0]
    try:
        async with asyncio.timeout(_RESOLVE_S):
            found = await asyncio.get_running_loop().getaddrinfo(name, _DISCARD_PORT, type=socket.SOCK_DGRAM)
    except (OSError, TimeoutError):
        return ""
    for family, kind, protocol, _, address in found:
        with suppress(OSError), socket.socket(family, kind, protocol) as probe:
            # Of a datagram socket, this only chooses the route (connect(2)).
            probe.connect(address)
            return _interface_of(str(probe.getsockname()[0]))
    return ""


def _interface_of(address: str) -> str:
    """Returns the interface that has an address."""
    wanted = ipaddress.ip_address(address.partition("%")[0])
    if wanted.version == 6:
        rows = (row.split() for row in _IF_INET6.read_text(encoding="ascii").splitlines())
        return next((row[-1] for row in rows if int(row[0], 16) == int(wanted)), "")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        for _, name in socket.if_nameindex():
            with suppress(OSError):  # It has no IPv4 address.
                answer = fcntl.ioctl(any_socket, _SIOCGIFADDR, struct.pack("256s", name.encode()))
                if ipaddress.ip_address(answer[20:24]) == wanted:
                    return name
    return ""
