"""The Unix socket that the gateway connects to: one packet is one message (SOCK_SEQPACKET of unix(7)).

Nothing here blocks. The gateway that is connected keeps the socket: a second one is refused until the first
has gone, because two would take the robot from each other.
"""

import logging
import select
import socket
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Final, Self

from common.bind import packet_socket
from drive.endpoint import wire
from drive.endpoint.wire import ProtocolError
from omniseer.drive.v1 import drive_pb2 as pb

_log = logging.getLogger(__name__)

_MAX_CONNECTIONS: Final = 9
"""The gateway and eight others, of whom the oldest has to go when one more comes."""
_MAX_PACKETS: Final = 64
"""Read at once from one connection; the cycle must not wait behind a flood."""


@dataclass(eq=False, slots=True)
class _Connection:
    socket: socket.socket
    greeted: bool = False
    gateway: bool = False


class Peer(Enum):
    """What the gateway's connection does."""

    JOINED = "joined"
    LEFT = "left"


Received = pb.ToDrive | Peer
"""A message of the gateway, or what became of its connection."""


class Endpoint:
    """Listens at `path` while its `with` block lasts.

    Args:
        path: a leftover of an earlier process is replaced.
        welcome: the answer to hello.

    Raises:
        UserError: the socket can't be made.
    """

    def __init__(self, path: Path, welcome: pb.FromDrive) -> None:
        self._path = path
        self._welcome = welcome.SerializeToString()
        self._connections: dict[int, _Connection] = {}
        self._poll = select.epoll()
        self._listener = packet_socket(path)
        self._poll.register(self._listener, select.EPOLLIN)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for connection in tuple(self._connections.values()):
            self._close(connection)
        self._listener.close()
        self._poll.close()
        self._path.unlink(missing_ok=True)

    @property
    def gateway_connected(self) -> bool:
        """Whether a gateway is connected."""
        return any(connection.gateway for connection in self._connections.values())

    def wait(self, timeout_s: float) -> list[Received]:
        """Waits for at most `timeout_s` for something to happen; returns what has, in its order.

        The order counts: what a gateway sent before its end must not outlive it.
        """
        received: list[Received] = []
        for descriptor, _ in self._poll.poll(max(0.0, timeout_s)):
            if descriptor == self._listener.fileno():
                self._accept()
            elif connection := self._connections.get(descriptor):
                self._read(connection, received)
        return received

    def send(self, message: pb.FromDrive) -> None:
        """Sends a message to all who are connected. A slow reader misses it: the next is newer."""
        packet = message.SerializeToString()
        for connection in tuple(self._connections.values()):
            if connection.greeted:
                self._send(connection, packet)

    def _send(self, connection: _Connection, packet: bytes) -> None:
        try:
            connection.socket.send(packet, socket.MSG_NOSIGNAL | socket.MSG_DONTWAIT)
        except BlockingIOError:
            pass  # Its buffer is full of older states.
        except OSError:
            # It has gone; reading from it will show that, and close it in its place.
            _log.debug("a reader of the state has gone")

    def _accept(self) -> None:
        try:
            accepted, _ = self._listener.accept()
        except OSError as error:
            _log.warning("a connection can't be accepted: %s", error)
            return
        if len(self._connections) >= _MAX_CONNECTIONS:
            # Observers that never leave must not keep the gateway out.
            self._close(next(each for each in self._connections.values() if not each.gateway))
        accepted.setblocking(False)
        self._connections[accepted.fileno()] = _Connection(accepted)
        self._poll.register(accepted, select.EPOLLIN)

    def _read(self, connection: _Connection, received: list[Received]) -> None:
        """Reads what has arrived; closes the connection at its end, or after a mistake of the other side."""
        try:
            for _ in range(_MAX_PACKETS):
                packet = connection.socket.recv(wire.MAX_MESSAGE_BYTES)
                if not packet:
                    break
                self._take(connection, wire.decoded(packet), received)
            else:
                return
        except BlockingIOError:
            return
        except (ProtocolError, OSError) as error:
            _log.warning("a connection is closed: %s", error)
        self._close(connection)
        if connection.gateway:
            received.append(Peer.LEFT)

    def _take(self, connection: _Connection, message: pb.ToDrive, received: list[Received]) -> None:
        hello = message.WhichOneof("message") == "hello"
        if not connection.greeted:
            if not hello:
                raise ProtocolError("it did not say hello")
            if message.hello.gateway and self.gateway_connected:
                raise ProtocolError("another gateway is connected")
            connection.greeted, connection.gateway = True, message.hello.gateway
            self._send(connection, self._welcome)
            if connection.gateway:
                received.append(Peer.JOINED)
        elif hello or not connection.gateway:
            raise ProtocolError("an observer only reads")
        else:
            received.append(message)

    def _close(self, connection: _Connection) -> None:
        del self._connections[connection.socket.fileno()]
        connection.socket.close()
