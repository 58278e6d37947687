"""What a response depends on besides the status itself: the way to its reader, and what that one may see."""

import logging
import socket
from dataclasses import dataclass
from functools import lru_cache
from ipaddress import ip_address
from typing import Final

from gateway.rpc.calls.call import CallContext, peer_of

_log = logging.getLogger(__name__)

_LOOPBACK: Final = "127.0.0.1"
_REMEMBERED_CONNECTIONS: Final = 256
_DISCARD_PORT: Final = 9


@dataclass(frozen=True, slots=True)
class Recipient:
    """Callers that get the same response.

    Attributes:
        robot_host: the robot's address as they reach it.
        sees_passphrase: whether they get the stream's passphrase: authenticated callers, and local ones.
    """

    robot_host: str
    sees_passphrase: bool


class Recipients:
    """Finds the recipient of a call's response.

    Args:
        advertised_host: the `robot_host` of all; None finds it out by the routing table.
    """

    def __init__(self, advertised_host: str | None) -> None:
        self._advertised_host = advertised_host
        # By connection: it keeps both its addresses for as long as it lives, and the next one may take
        # another route.
        self._remembered = lru_cache(maxsize=_REMEMBERED_CONNECTIONS)(self._of)

    def of(self, call: CallContext) -> Recipient:
        """Returns the recipient of this call's response."""
        return self._remembered(call.peer.connection, call.principal is not None)

    def _of(self, connection: str, authenticated: bool) -> Recipient:
        ip = peer_of(connection).ip
        local = ip is None or ip_address(ip.partition("%")[0]).is_loopback
        host = self._advertised_host or (_LOOPBACK if ip is None or local else _own_address_towards(ip))
        return Recipient(robot_host=host, sees_passphrase=local or authenticated)


def _own_address_towards(ip: str) -> str:
    """Asks the routing table: connecting a UDP socket sends nothing."""
    family = socket.AF_INET6 if ":" in ip else socket.AF_INET
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect((ip, _DISCARD_PORT))
            return str(probe.getsockname()[0])
    except OSError as error:
        # The host name is the next best: the client may be able to resolve it.
        _log.warning("no route to the caller %s (%s); viewers get this host's name instead", ip, error)
        return socket.gethostname()
