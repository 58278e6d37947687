"""Ports and ROS domains that nobody uses."""

import fcntl
import os
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from common.errors import UserError

_DOMAINS = range(1, 102)
_LOOPBACK = "127.0.0.1"


def free_port(kind: socket.SocketKind) -> int:
    """A port of the loopback address that was free a moment ago."""
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind((_LOOPBACK, 0))
        return int(probe.getsockname()[1])


def is_free(kind: socket.SocketKind, port: int) -> bool:
    """Whether the port can be bound now."""
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


@contextmanager
def free_domain() -> Iterator[int]:
    """A ROS domain without a participant on this machine, ours until the block ends.

    A lock per domain keeps two demos, or a demo and a test, from choosing the same one at the same time.
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
    raise UserError("all ROS domains are in use", "Name one with --domain")


def _is_silent(domain: int) -> bool:
    """Whether nobody listens on the domain's discovery port (RTPS: 7400 + 250 x domain)."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", 7400 + 250 * domain))
        except OSError:
            return False
    return True
