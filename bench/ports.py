"""Ports for programs that a benchmark starts."""

import socket


def free_udp_port() -> int:
    """A UDP port that nobody used a moment ago."""
    return _free(socket.SOCK_DGRAM)


def free_tcp_port() -> int:
    """A TCP port that nobody used a moment ago."""
    return _free(socket.SOCK_STREAM)


def _free(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("", 0))
        return int(probe.getsockname()[1])
