"""The TCP connections that this process has accepted at one port, found among its own descriptors.

gRPC's Python API neither reports connections nor closes one: a peer that makes no call is invisible there.
"""

import os
import socket
import stat
from contextlib import suppress
from pathlib import Path
from typing import Final

_DESCRIPTORS: Final = Path("/proc/self/fd")
_FAMILIES: Final = frozenset({socket.AF_INET, socket.AF_INET6})


class AcceptedSockets:
    """Finds and closes connections.

    Args:
        port: the local port.
    """

    def __init__(self, port: int) -> None:
        self._port = port
        self._addresses: dict[int, str] = {}
        """By inode, which is the socket's own as long as it lives; empty for those that are none of ours."""
        self._descriptors: dict[str, int] = {}

    def scan(self) -> list[str]:
        """Returns the addresses of the peers, as `Peer.address` spells them.

        Raises:
            OSError: the descriptors can't be listed, for want of one.
        """
        with os.scandir(_DESCRIPTORS) as entries:
            descriptors = [int(each.name) for each in entries]
        known, self._addresses, self._descriptors = self._addresses, {}, {}
        for descriptor in descriptors:
            # Any descriptor may be closed meanwhile, that of this listing certainly is.
            with suppress(OSError):
                status = os.fstat(descriptor)
                if not stat.S_ISSOCK(status.st_mode):
                    continue
                address = known.get(status.st_ino)
                if address is None:
                    address = self._peer_address(descriptor)
                self._addresses[status.st_ino] = address
                if address:
                    self._descriptors[address] = descriptor
        return list(self._descriptors)

    def close(self, address: str) -> bool:
        """Ends the connection that `scan` found with this peer, and returns whether it was still there.

        gRPC keeps the descriptor and closes it when it reads the end of the stream.
        """
        descriptor = self._descriptors.pop(address, None)
        if descriptor is None:
            return False
        with suppress(OSError), _duplicate(descriptor) as ours:
            # The number may belong to another socket by now.
            if _address_of(ours) == address:
                ours.shutdown(socket.SHUT_RDWR)
                return True
        return False

    def _peer_address(self, descriptor: int) -> str:
        with _duplicate(descriptor) as ours:
            if ours.family not in _FAMILIES or ours.type != socket.SOCK_STREAM:
                return ""
            if ours.getsockname()[1] != self._port:
                return ""
            try:
                return _address_of(ours)
            except OSError:
                return ""  # it listens


def _duplicate(descriptor: int) -> socket.socket:
    """Returns another descriptor of the same socket, which stays the same while gRPC closes its own."""
    return socket.socket(fileno=os.dup(descriptor))


def _address_of(connected: socket.socket) -> str:
    """Returns the peer's address as gRPC spells it, by which it is found among those that make calls."""
    host, port, *ipv6 = connected.getpeername()
    if not ipv6:
        return f"{host}:{port}"
    if "." in host:
        # An IPv4 peer of a listener for both (RFC 4291 2.5.5.2).
        return f"{host.removeprefix('::ffff:')}:{port}"
    _, scope_id = ipv6
    return f"[{host}%{scope_id}]:{port}" if scope_id else f"[{host}]:{port}"
