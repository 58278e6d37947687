"""Names and addresses by which other machines may reach this one."""

import ipaddress
import socket
from collections.abc import Iterable
from pathlib import Path

import psutil

from gateway.platform.network import default_interface

_LOOPBACK = ("localhost", "127.0.0.1", "::1")
"""Always included: clients behind a tunnel connect to these."""


def find_hosts() -> tuple[str, ...]:
    """Returns the host name, its mDNS name (".local", RFC 6762 3), and all lasting addresses."""
    name = socket.gethostname().partition(".")[0]
    interfaces = psutil.net_if_addrs().values()
    addresses = [each.address for interface in interfaces for each in interface if _is_lasting(each.address)]
    return with_loopback((name, f"{name}.local", socket.getfqdn(), *sorted(addresses)))


def advertised_addresses(host: str, only: tuple[str, ...]) -> tuple[str, ...]:
    """Returns the addresses under which a gateway is announced to its network, sorted.

    Args:
        host: where it listens. One address is that address alone.
        only: addresses of this machine to choose from; empty: those of the interface that leads to the
            operators, the one of the default route.
    """
    if host not in ("0.0.0.0", "::"):  # noqa: S104  # compared
        return (host,)
    if only:
        return tuple(sorted(only))
    interfaces = psutil.net_if_addrs()
    interface = default_interface(Path("/proc"))
    chosen = [interfaces[interface]] if interface in interfaces else interfaces.values()
    return tuple(sorted({each.address for part in chosen for each in part if _is_lasting(each.address)}))


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
