"""Ports nobody uses."""

import socket


def free_udp_port() -> int:
    """A UDP port that was free on every local address a moment ago."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        return int(probe.getsockname()[1])


def free_tcp_port() -> int:
    """A TCP port that was free on every local address a moment ago."""
    with socket.socket() as probe:
        probe.bind(("", 0))
        return int(probe.getsockname()[1])
