"""Finds free ports and ROS domains on this machine.

Programs that start at the same time (two demos, the workers of a test run) must not choose the same one. Each
therefore claims its choice by binding a name in the abstract namespace of Unix sockets (unix(7)). Such a name
has one owner per network namespace, as a port has, and disappears with its process.
"""

import errno
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Final

from common.errors import UserError

_PORT_BLOCKS: Final = tuple(range(61_000, 65_500, 125))
"""First port of each block. All lie above the ephemeral ports (net.ipv4.ip_local_port_range, by default 32768
to 60999), so that no outgoing connection takes a port between our check and the program's bind."""
_BLOCK_SIZE: Final = 125
_DOMAINS: Final = range(1, 102)
"""Ports of higher domains reach into the ephemeral ports (DDSI-RTPS 9.6: 7400 + 250 x domain)."""
_LOOPBACK: Final = "127.0.0.1"
_ANY_ADDRESS: Final = ""

_ports: Iterator[int] | None = None
"""This process's block of ports, endlessly repeated; None until the first port is needed."""


def free_port(kind: socket.SocketKind) -> int:
    """Returns a port of this process's block that is free on every local address.

    Raises:
        UserError: every block is claimed, or no port of this process's block is free.
    """
    global _ports  # noqa: PLW0603 - one block per process, shared by all callers
    if _ports is None:
        _ports = _claimed_block()
    for _ in range(_BLOCK_SIZE):
        port = next(_ports)
        if _can_bind(kind, _ANY_ADDRESS, port):
            return port
    raise UserError(
        "none of the ports reserved for this program is free", "Stop the programs that use them (ss -tulnp)"
    )


def port_is_free(kind: socket.SocketKind, port: int) -> bool:
    """Returns whether this port of 127.0.0.1 can be bound now."""
    return _can_bind(kind, _LOOPBACK, port)


free_tcp_port = partial(free_port, socket.SOCK_STREAM)
free_udp_port = partial(free_port, socket.SOCK_DGRAM)
udp_port_is_free = partial(port_is_free, socket.SOCK_DGRAM)


@contextmanager
def free_domain() -> Iterator[int]:
    """Yields a ROS domain without participants on this machine, claimed until the block ends.

    Raises:
        UserError: every domain is in use.
    """
    first = os.getpid() % len(_DOMAINS)
    for domain in (*_DOMAINS[first:], *_DOMAINS[:first]):
        claim = _claim(f"ros-domain-{domain}")
        if claim is None:
            continue
        with claim:
            # The domain's multicast discovery port, which all its participants share.
            if _can_bind(socket.SOCK_DGRAM, _ANY_ADDRESS, 7400 + 250 * domain):
                yield domain
                return
    raise UserError("all ROS domains are in use", "Stop unused ROS programs, or choose a domain yourself")


def _claimed_block() -> Iterator[int]:
    for first in _PORT_BLOCKS:
        if claim := _claim(f"ports-{first}"):
            return _round_robin(first, claim)
    raise UserError(
        f"all {len(_PORT_BLOCKS)} blocks of free ports are claimed by other programs", "Stop demos or tests"
    )


def _round_robin(first: int, claim: socket.socket) -> Iterator[int]:
    # Repeats the whole block before any port, because sockets may close late. The iterator holds the claim.
    with claim:
        while True:
            yield from range(first, first + _BLOCK_SIZE)


def _claim(name: str) -> socket.socket | None:
    """Returns a socket that holds the claim until it is closed; None if another program holds it."""
    holder = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        holder.bind(f"\0robot-gateway-{name}")
    except OSError as error:
        holder.close()
        if error.errno != errno.EADDRINUSE:
            raise
        return None
    return holder


def _can_bind(kind: socket.SocketKind, address: str, port: int) -> bool:
    with socket.socket(socket.AF_INET, kind) as probe:
        if kind is socket.SOCK_STREAM:
            # A closed connection in TIME-WAIT (RFC 9293 3.6.1) does not keep a listener out.
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((address, port))
            if kind is socket.SOCK_STREAM:
                probe.listen()
        except OSError:
            return False
    return True
