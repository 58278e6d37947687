"""Names and addresses by which other machines may reach this one."""

import ipaddress
import socket
from collections.abc import Iterable

import psutil

_LOOPBACK = ("localhost", "127.0.0.1", "::1")
"""Always included: clients behind a tunnel connect to these."""


def find_hosts() -> tuple[str, ...]:
    """Returns the host name, its mDNS name (".local", RFC 6762 3), and all lasting addresses."""
    name = socket.gethostname().partition(".")[0]
    interfaces = psutil.net_if_addrs().values()
    addresses = [each.address for interface in interfaces for each in interface if _is_lasting(each.address)]
    return with_loopback((name, f"{name}.local", socket.getfqdn(), *sorted(addresses)))


def with_loopback(hosts: Iterable[str]) -> tuple[str, ...]:
    """Returns the hosts and the loopback names and addresses, each once."""
    return tuple(dict.fromkeys(host for host in (*hosts, *_LOOPBACK) if host))


def _is_lasting(text: str) -> bool:
    """Returns whether this is an IP address that other machines can use, now and later."""
    try:
        address = ipaddress.ip_address(text)
    except ValueError:
        return False
    return not (address.is_loopback or address.is_link_local or address.is_multicast)
