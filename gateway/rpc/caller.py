"""Who asks, and by which of our addresses: what an answer may depend on besides the status itself."""

import logging
import socket
from dataclasses import dataclass
from functools import lru_cache
from ipaddress import ip_address
from typing import Final

from gateway.rpc.identity import caller
from gateway.rpc.peer import ip_of

_log = logging.getLogger(__name__)

_LOOPBACK: Final = "127.0.0.1"
_REMEMBERED_CONNECTIONS: Final = 256
_DISCARD_PORT: Final = 9


@dataclass(frozen=True, slots=True)
class Caller:
    """One client, as far as answers differ.

    Attributes:
        robot_host: the robot's address as this client reaches it.
        may_watch: whether it may have the stream's passphrase. Whoever has proved who they are may, and
            callers on the robot itself.
    """

    robot_host: str
    may_watch: bool


class Callers:
    """Tells callers apart by gRPC's peer strings.

    Args:
        advertised_host: what `robot_host` is for everybody; None to find it out per connection.
    """

    def __init__(self, advertised_host: str | None) -> None:
        self._advertised_host = advertised_host
        # A connection keeps both its addresses for as long as it lives.
        self._remembered = lru_cache(maxsize=_REMEMBERED_CONNECTIONS)(self._of)

    def of(self, peer: str) -> Caller:
        """Who is at the other end of a connection."""
        return self._remembered(peer, caller() is not None)

    def _of(self, peer: str, known: bool) -> Caller:
        address = ip_of(peer)
        local = address is None or ip_address(address.partition("%")[0]).is_loopback
        host = self._advertised_host or (_LOOPBACK if address is None or local else _our_side(address))
        return Caller(robot_host=host, may_watch=local or known)


def _our_side(address: str) -> str:
    """Our own address on the way to `address`. Asks the routing table; nothing is sent."""
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect((address, _DISCARD_PORT))
            return str(probe.getsockname()[0])
    except OSError as error:
        # The name is the next best: the client may know it.
        _log.warning("no route to the caller %s (%s); viewers are sent to this host's name", address, error)
        return socket.gethostname()
