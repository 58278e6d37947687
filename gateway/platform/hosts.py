"""By which names and addresses this machine may be called."""

import ipaddress
import socket
from collections.abc import Iterable

import psutil

_LOCAL = ("localhost", "127.0.0.1", "::1")
"""Always: who comes through a tunnel calls these."""


def hosts_found() -> tuple[str, ...]:
    """Host name, the same with ".local" (mDNS), and every address that other machines may know."""
    name = socket.gethostname().partition(".")[0]
    full = socket.getfqdn()
    addresses = [
        each.address
        for interface in psutil.net_if_addrs().values()
        for each in interface
        if _lasts(each.address)
    ]
    return with_local((name, f"{name}.local", full, *sorted(addresses)))


def with_local(hosts: Iterable[str]) -> tuple[str, ...]:
    """These and those that always count, each once."""
    return tuple(dict.fromkeys(host for host in (*hosts, *_LOCAL) if host))


def _lasts(text: str) -> bool:
    """Whether it is an address by which others may call for more than a moment."""
    try:
        address = ipaddress.ip_address(text)
    except ValueError:
        return False
    return not (address.is_loopback or address.is_link_local or address.is_multicast)
