"""A descriptor that gRPC closes between two steps of a look may belong to any other socket by then."""

import os
import socket
from contextlib import ExitStack

import pytest

from gateway.rpc.connections.accepted_sockets import AcceptedSockets

_HOST = "127.0.0.1"


def successor(family: socket.AddressFamily) -> socket.socket:
    """Returns one end of a pair of connected sockets of this family."""
    if family == socket.AF_UNIX:
        ours, theirs = socket.socketpair()
        theirs.close()
        return ours
    return socket.socket(family, socket.SOCK_DGRAM)


@pytest.mark.parametrize(
    "family", [socket.AF_UNIX, socket.AF_NETLINK, socket.AF_INET], ids=lambda each: each.name
)
def test_another_socket_with_its_number_is_left_alone(family: socket.AddressFamily) -> None:
    with ExitStack() as stack:
        listening = stack.enter_context(socket.create_server((_HOST, 0)))
        port = listening.getsockname()[1]
        peer = stack.enter_context(socket.create_connection((_HOST, port)))
        accepted, _ = listening.accept()
        address = f"{_HOST}:{peer.getsockname()[1]}"
        sockets = AcceptedSockets(port)
        assert address in sockets.scan()

        other = stack.enter_context(successor(family))
        # Closes what was accepted, as gRPC does, and gives its number to the other.
        os.dup2(other.fileno(), accepted.fileno())
        stack.callback(accepted.close)

        assert sockets.received_bytes(address) == 0
        assert not sockets.close(address)
