"""Through which network interface the store is reached; IPv4 and IPv6, on Linux.

The kernel is asked for its route (rtnetlink(7), RTM_GETROUTE). The address that a socket would send from does
not name the interface: one may have several addresses, and several may have the same.
"""

import asyncio
import ipaddress
import socket
import struct
from contextlib import suppress
from typing import Final

_RESOLVE_S: Final = 5.0
_ANSWER_S: Final = 1.0
"""The kernel answers at once."""
_LONGEST_ANSWER: Final = 8192

# linux/netlink.h and linux/rtnetlink.h.
_HEADER: Final = struct.Struct("=IHHII")
"""nlmsghdr: length, type, flags, sequence, port."""
_ROUTE: Final = struct.Struct("=BBBBBBBBI")
"""rtmsg: family, length of the destination in bits, what a request leaves at 0. The eighth: type."""
_ATTRIBUTE: Final = struct.Struct("=HH")
"""rtattr: length with this header, type."""
_INDEX: Final = struct.Struct("=i")
_NLM_F_REQUEST: Final = 1
_RTM_NEWROUTE: Final = 24
_RTM_GETROUTE: Final = 26
_RTA_DST: Final = 1
_RTA_OIF: Final = 4
_NETLINK_ROUTE: Final = 0
_USABLE: Final = frozenset({1, 2})
"""RTN_UNICAST and RTN_LOCAL. For IPv6, an unreachable route is an answer, too."""


async def interface_to(host: str) -> str:
    """Returns the name of the interface; empty if there is no route, or the name can't be resolved.

    Args:
        host: HOST or HOST:PORT.
    """
    name = host.partition(":")[0]
    try:
        async with asyncio.timeout(_RESOLVE_S):
            found = await asyncio.get_running_loop().getaddrinfo(name, None, type=socket.SOCK_STREAM)
    except (OSError, TimeoutError, UnicodeError):
        return ""
    for *_, address in found:
        # The one that is connected to first; one without a route is passed over.
        with suppress(OSError):
            return interface_of(str(address[0]))
    return ""


def interface_of(address: str) -> str:
    """Returns the interface of the route to an address.

    Raises:
        OSError: There is none.
    """
    to = ipaddress.ip_address(address.partition("%")[0])
    family = socket.AF_INET6 if to.version == 6 else socket.AF_INET
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW | socket.SOCK_CLOEXEC, _NETLINK_ROUTE) as kernel:
        kernel.settimeout(_ANSWER_S)
        kernel.sendto(_request(family, to.packed), (0, 0))
        index = index_of(kernel.recv(_LONGEST_ANSWER))
    if index is None:
        raise OSError(f"no route to {to}")
    return socket.if_indextoname(index)


def _request(family: int, destination: bytes) -> bytes:
    """Returns the question for the route to an address."""
    attribute = _ATTRIBUTE.pack(_ATTRIBUTE.size + len(destination), _RTA_DST) + destination
    body = _ROUTE.pack(family, len(destination) * 8, 0, 0, 0, 0, 0, 0, 0) + attribute
    return _HEADER.pack(_HEADER.size + len(body), _RTM_GETROUTE, _NLM_F_REQUEST, 1, 0) + body


def index_of(answer: bytes) -> int | None:
    """Returns the number of the interface that the kernel's answer names; None if it names none."""
    if len(answer) < _HEADER.size + _ROUTE.size:
        return None
    length, kind, *_ = _HEADER.unpack_from(answer)
    if kind != _RTM_NEWROUTE or _ROUTE.unpack_from(answer, _HEADER.size)[7] not in _USABLE:
        return None
    offset = _HEADER.size + _ROUTE.size
    while offset + _ATTRIBUTE.size <= min(length, len(answer)):
        size, name = _ATTRIBUTE.unpack_from(answer, offset)
        if name == _RTA_OIF and size == _ATTRIBUTE.size + _INDEX.size and offset + size <= len(answer):
            index: int = _INDEX.unpack_from(answer, offset + _ATTRIBUTE.size)[0]
            return index if index > 0 else None
        # Attributes begin at multiples of 4.
        offset += max(_ATTRIBUTE.size, size + 3 & ~3)
    return None
