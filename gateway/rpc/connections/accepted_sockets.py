"""The TCP connections that this process has accepted at one port, found among its own descriptors.

gRPC's Python API neither reports connections nor closes one: a peer that makes no call is invisible there.
"""

import os
import socket
import stat
import struct
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Final

from gateway.rpc.connections import packet_filter
from gateway.rpc.connections.packet_filter import ConnectPolicy

_DESCRIPTORS: Final = Path("/proc/self/fd")
_FAMILIES: Final = frozenset({socket.AF_INET, socket.AF_INET6})
_NONE: Final = -1
"""No descriptor."""
_BYTES_RECEIVED: Final = struct.Struct("128xQ")
"""tcpi_bytes_received in struct tcp_info (linux/tcp.h, since 4.1)."""
_SO_MAX_PACING_RATE: Final = 47
"""asm-generic/socket.h, since 3.13; Python's socket module does not have it. TCP paces by itself since 4.13,
whatever the queueing discipline."""
UNLIMITED: Final = 0xFFFF_FFFF
"""The rate of a connection that is not throttled."""
_LISTENS: Final = "listens"
"""In place of an address, of the socket that accepts the connections."""


class AcceptedSockets:
    """Finds and closes connections, and keeps addresses from making any.

    Args:
        port: the local port.
    """

    def __init__(self, port: int) -> None:
        self._port = port
        self._addresses: dict[int, str] = {}
        """By inode, which is the socket's own as long as it lives; empty for those that are none of ours."""
        self._descriptors: dict[str, int] = {}
        self._listening: dict[int, int] = {}
        """Descriptors by inode: those of `listening` are others of the same sockets."""

    def scan(self) -> list[str]:
        """Returns the addresses of the peers, as `Peer.address` spells them.

        Raises:
            OSError: the descriptors can't be listed, for want of one.
        """
        with os.scandir(_DESCRIPTORS) as entries:
            descriptors = [int(each.name) for each in entries]
        known, self._addresses, self._descriptors, self._listening = self._addresses, {}, {}, {}
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
                if address == _LISTENS:
                    self._listening[status.st_ino] = descriptor
                elif address:
                    self._descriptors[address] = descriptor
        return list(self._descriptors)

    def close(self, address: str) -> bool:
        """Ends the connection that `scan` found with this peer, and returns whether it was still there.

        gRPC keeps the descriptor and closes it when it reads the end of the stream.
        """
        with suppress(OSError), self._connection(address) as connection:
            del self._descriptors[address]
            connection.shutdown(socket.SHUT_RDWR)
            return True
        return False

    def throttle(self, address: str, bytes_per_s: int) -> None:
        """Bounds the rate at which this peer is answered, until it is called again with UNLIMITED.

        A peer that waits for answers before it calls again is slowed down by it, at no cost.
        """
        with suppress(OSError), self._connection(address) as connection:
            rate = struct.pack("=I", bytes_per_s)
            connection.setsockopt(socket.SOL_SOCKET, _SO_MAX_PACING_RATE, rate)

    def mute(self, address: str) -> bool:
        """Makes the kernel drop every further packet of this peer, and returns whether it does.

        Unlike a peer whose connection is closed, it does not connect again before it has noticed. gRPC closes
        the connection when a keepalive ping stays unanswered. Some kernels permit it to root alone.
        """
        with suppress(OSError), self._connection(address) as connection:
            packet_filter.attach(connection, packet_filter.DROP_ALL)
            return True
        return False

    def apply(self, policy: ConnectPolicy) -> bool:
        """Makes the kernel drop the attempts to connect that the policy does not let through, and no others.

        Open connections stay open. An attempt that is dropped gets no answer at all.

        Returns:
            Whether it does. Some kernels permit it to root alone.
        """
        program = packet_filter.program_of(policy)
        try:
            with self.listening() as listening:
                for each in listening:
                    packet_filter.attach(each, program)
        except OSError:
            return False
        return bool(self._listening)

    @contextmanager
    def listening(self) -> Iterator[list[socket.socket]]:
        """Yields duplicates of the sockets that accept the connections, as far as `scan` has found them.

        Raises:
            OSError: one was closed meanwhile, or no descriptor is left.
        """
        with ExitStack() as stack:
            duplicates = [stack.enter_context(_duplicate(each)) for each in self._listening.values()]
            # A number may belong to another socket by now.
            yield [each for each in duplicates if _listens(each)]

    def received_bytes(self, address: str) -> int:
        """Returns how much this peer has sent since it connected; 0 where that is not known."""
        with suppress(OSError), self._connection(address) as connection:
            info = connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, _BYTES_RECEIVED.size)
            return int(_BYTES_RECEIVED.unpack(info)[0]) if len(info) == _BYTES_RECEIVED.size else 0
        return 0

    def _connection(self, address: str) -> socket.socket:
        """Returns a duplicate of the socket that `scan` found with this peer.

        Raises:
            OSError: it was closed meanwhile.
        """
        ours = _duplicate_of_tcp(self._descriptors.get(address, _NONE))
        try:
            # The number may belong to another socket by now, of any family.
            if _address_of(ours) != address:
                raise ConnectionError(address)
        except OSError:
            ours.close()
            raise
        return ours

    def _peer_address(self, descriptor: int) -> str:
        with _duplicate(descriptor) as ours:
            if ours.family not in _FAMILIES or ours.type != socket.SOCK_STREAM:
                return ""
            if ours.getsockname()[1] != self._port:
                return ""
            return _LISTENS if _listens(ours) else _address_of(ours)


def _duplicate(descriptor: int) -> socket.socket:
    """Returns another descriptor of the same socket, which stays the same while gRPC closes its own."""
    return socket.socket(fileno=os.dup(descriptor))


def _duplicate_of_tcp(descriptor: int) -> socket.socket:
    """As `_duplicate`, of what is a TCP socket: Python makes two system calls less to find out what it is."""
    return socket.socket(socket.AF_INET6, socket.SOCK_STREAM, socket.IPPROTO_TCP, fileno=os.dup(descriptor))


def _listens(ours: socket.socket) -> bool:
    return bool(ours.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN))


def _address_of(connected: socket.socket) -> str:
    """Returns the peer's address as gRPC spells it, by which it is found among those that make calls.

    Raises:
        OSError: there is no peer, or it is none of TCP's; `_duplicate_of_tcp` does not find out.
    """
    peer = connected.getpeername()
    if not isinstance(peer, tuple):
        raise ConnectionError(f"{peer!r} is no peer of TCP")  # but the path of a Unix socket
    host, port, *ipv6 = peer
    if not ipv6:
        return f"{host}:{port}"
    if "." in host:
        # An IPv4 peer of a listener for both (RFC 4291 2.5.5.2).
        return f"{host.removeprefix('::ffff:')}:{port}"
    _, scope_id = ipv6
    return f"[{host}%{scope_id}]:{port}" if scope_id else f"[{host}]:{port}"
