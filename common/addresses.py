"""Hosts as configurations and addresses name them."""

import ipaddress


def bracketed(host: str) -> str:
    """Returns the host as it precedes ":PORT": an IPv6 address in brackets (RFC 3986 3.2.2)."""
    return f"[{host}]" if ":" in host and not host.startswith("[") else host


def is_loopback(host: str) -> bool:
    """Returns whether only this machine can reach the address. Names other than localhost count as public."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False
