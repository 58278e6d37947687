"""Ports and ROS domains that nobody on this machine uses."""

import fcntl
import os
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from common.errors import UserError

_DOMAINS: Final = range(1, 102)
"""Beyond 101 the ports of a domain reach into the range that Linux hands out to anybody."""
_LOOPBACK: Final = "127.0.0.1"


def free_port(kind: socket.SocketKind) -> int:
    """A port that was free on every local address a moment ago."""
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("", 0))
        return int(probe.getsockname()[1])


def port_is_free(kind: socket.SocketKind, port: int) -> bool:
    """Whether a program could listen on this port of 127.0.0.1 now."""
    with socket.socket(socket.AF_INET, kind) as probe:
        if kind is socket.SOCK_STREAM:
            # What a closed connection leaves behind for a minute is in nobody's way.
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((_LOOPBACK, port))
            if kind is socket.SOCK_STREAM:
                probe.listen()
        except OSError:
            return False
    return True


def free_tcp_port() -> int:
    """A TCP port that was free on every local address a moment ago."""
    return free_port(socket.SOCK_STREAM)


def free_udp_port() -> int:
    """A UDP port that was free on every local address a moment ago."""
    return free_port(socket.SOCK_DGRAM)


def udp_port_is_free(port: int) -> bool:
    """Whether a program could listen on this UDP port of 127.0.0.1 now."""
    return port_is_free(socket.SOCK_DGRAM, port)


@contextmanager
def free_domain() -> Iterator[int]:
    """A ROS domain without a participant on this machine, ours until the block ends.

    A lock per domain keeps two demos, or a demo and a test, from choosing the same one at the same time.

    Raises:
        UserError: every domain is in use.
    """
    locks = Path(tempfile.gettempdir()) / f"robot-gateway-ros-domains-{os.getuid()}"
    locks.mkdir(exist_ok=True)
    first = os.getpid() % len(_DOMAINS)
    for domain in (*_DOMAINS[first:], *_DOMAINS[:first]):
        with (locks / str(domain)).open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            if _is_silent(domain):
                yield domain
                return
    raise UserError("all ROS domains are in use", "Stop what nobody needs any more, or choose one yourself")


def _is_silent(domain: int) -> bool:
    """Whether nobody listens on the domain's discovery port (RTPS: 7400 + 250 x domain)."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", 7400 + 250 * domain))
        except OSError:
            return False
    return True
