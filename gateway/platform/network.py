"""State of the network interface that leads to the operator."""

import socket
from pathlib import Path
from typing import Final

import psutil

from gateway.status.values import Network

_DEFAULT_ROUTE: Final = "00000000"
_QUALITY_SCALE: Final = 70
"""Maximum link quality of Linux drivers."""
_LEAST_FIELDS: Final = 4
"""Columns of /proc/net/wireless up to the signal."""
_PLAUSIBLE_DBM: Final = range(-120, 0)
"""A disconnected interface reports -256."""
_DEFAULT_ROUTE_6: Final = ("0" * 32, "00")
"""Destination and prefix length."""
_UNREACHABLE_6: Final = 0x0200
"""RTF_REJECT; the kernel itself adds a default route with this flag."""


def read(interface: str | None, proc: Path = Path("/proc")) -> Network:
    """Samples an interface.

    Args:
        interface: its name; None for the interface of the default route.
        proc: mount point of procfs.
    """
    name = interface or default_interface(proc)
    if name is None:
        return Network(interface_name="", connected=False, wifi_signal_dbm=None, link_quality_percent=None)
    quality, signal = wireless(name, proc)
    return Network(
        interface_name=name,
        connected=_is_up(name) and _has_address(name),
        wifi_signal_dbm=signal,
        link_quality_percent=quality,
    )


def default_interface(proc: Path) -> str | None:
    """Returns the interface of the default route with the lowest metric, IPv4 first; None without a route."""
    out = _default_routes_4(proc) or _default_routes_6(proc)
    return min(out)[1] if out else None


def _default_routes_4(proc: Path) -> list[tuple[int, str]]:
    """Returns metric and interface of each IPv4 default route."""
    routes = [line.split() for line in _lines(proc / "net/route")[1:]]
    return [(int(route[6]), route[0]) for route in routes if len(route) > 6 and route[1] == _DEFAULT_ROUTE]


def _default_routes_6(proc: Path) -> list[tuple[int, str]]:
    routes = [line.split() for line in _lines(proc / "net/ipv6_route")]
    return [
        (int(route[5], 16), route[9])
        for route in routes
        if len(route) > 9
        and (route[0], route[1]) == _DEFAULT_ROUTE_6
        and not int(route[8], 16) & _UNREACHABLE_6
    ]


def wireless(name: str, proc: Path) -> tuple[int | None, int | None]:
    """Returns link quality in percent and signal in dBm; None for values that the driver does not report."""
    for line in _lines(proc / "net/wireless"):
        fields = line.split()
        if len(fields) >= _LEAST_FIELDS and fields[0] == f"{name}:":
            quality, signal = (float(field) for field in fields[2:4])
            return (
                min(100, round(100 * quality / _QUALITY_SCALE)) if quality >= 0 else None,
                int(signal) if int(signal) in _PLAUSIBLE_DBM else None,
            )
    return None, None


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return []


def _is_up(name: str) -> bool:
    stats = psutil.net_if_stats().get(name)
    return stats is not None and stats.isup


def _has_address(name: str) -> bool:
    return any(
        address.family == socket.AF_INET
        or (address.family == socket.AF_INET6 and not address.address.startswith("fe80:"))
        for address in psutil.net_if_addrs().get(name, [])
    )
