"""Where a caller sits on the network."""

import ipaddress
from typing import Final

_IPV6_SITE: Final = 64
"""Bits of an IPv6 address that one site can't choose."""


def site_of(host: str) -> str:
    """What one sender can't change at will: an IPv4 address, the first half of an IPv6 address."""
    try:
        address = ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        return host
    if address.version == 6 and address.ipv4_mapped is None:
        return str(ipaddress.ip_network((address, _IPV6_SITE), strict=False).network_address)
    return str(getattr(address, "ipv4_mapped", None) or address)
