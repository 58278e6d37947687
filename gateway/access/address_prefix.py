"""Groups network addresses by the part that a sender can't choose, for limits per address."""

import ipaddress
from functools import lru_cache
from typing import Final

_IPV6_PREFIX_BITS: Final = 64
"""A host chooses the remaining 64 bits freely (interface identifier, RFC 4291 2.5.1)."""
_REMEMBERED: Final = 1024


def host_of(address: str) -> str:
    """Returns the host of "HOST:PORT", without the brackets of IPv6."""
    return address.rpartition(":")[0].strip("[]")


@lru_cache(maxsize=_REMEMBERED)  # a crowd comes from few hosts
def address_prefix(host: str) -> str:
    """Returns an IPv4 address as it is, the /64 prefix of an IPv6 address, and any other text unchanged."""
    try:
        address = ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        return host
    if address.version == 6 and address.ipv4_mapped is None:
        return str(ipaddress.ip_network((address, _IPV6_PREFIX_BITS), strict=False).network_address)
    return str(getattr(address, "ipv4_mapped", None) or address)
