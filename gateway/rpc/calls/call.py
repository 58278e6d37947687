"""One call of an operator: where it comes from, who makes it, how long it may take."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final
from urllib.parse import unquote

from google.protobuf.message import Message

from common.errors import DomainError
from common.interceptors import Call, RpcContext
from gateway.access.address_prefix import address_prefix
from gateway.access.credential import Principal
from gateway.rpc.calls.methods import Method

_LOCAL_SOCKET: Final = "local socket"
_REMEMBERED_CONNECTIONS: Final = 256


@dataclass(frozen=True, slots=True)
class Peer:
    """The other end of a connection.

    Attributes:
        connection: gRPC's own name, the same for all calls of a connection: "ipv4:10.0.0.5:41234".
        address: for people: "10.0.0.5:41234", or "local socket" for a Unix one.
        host: the address without its port.
        ip: IPv4 also where IPv6 carries it (RFC 4291 2.5.5.2); None for a Unix socket.
        address_prefix: what one sender can't change at will, see `gateway.access.address_prefix`.
    """

    connection: str
    address: str
    host: str
    ip: str | None
    address_prefix: str


@lru_cache(maxsize=_REMEMBERED_CONNECTIONS)
def peer_of(connection: str) -> Peer:
    """Returns the peer that gRPC calls `connection`."""
    scheme, _, rest = unquote(connection).partition(":")
    if scheme not in {"ipv4", "ipv6"}:
        return Peer(connection, _LOCAL_SOCKET, _LOCAL_SOCKET, None, _LOCAL_SOCKET)
    host = rest.rpartition(":")[0].strip("[]") or rest
    ip = host.removeprefix("::ffff:") if "." in host else host
    return Peer(connection, rest, host, ip, address_prefix(host))


class CallContext(Call):
    """What interceptors and handlers know of a call.

    Attributes:
        method: as the schema describes it.
        peer: where the call comes from.
        principal: who makes it; None until `Auth` has found out, and where callers are not authenticated.
        refusal: why `Auth` or `Authorization` refuses the call, while the refusal is delayed and after, or
            why `Auth` has ended it; None otherwise.
        examined: whether it has one of its connection's turns (`Turns`).
        waited_s: how long it waited for that; 0 if it did not have to.
        unlimited: whether no limit applies to it: a stop, unless its caller shows no valid credential
            (`Exemption`).
        request: the first message of the caller; None before it.
        responded: whether a message has left for the caller.
        response: the newest message to the caller, of control actions alone; serialised or not.
    """

    __slots__ = (
        "examined",
        "peer",
        "principal",
        "refusal",
        "request",
        "responded",
        "response",
        "unlimited",
        "waited_s",
    )

    method: Method
    principal: Principal | None
    refusal: DomainError | None
    request: Message | None
    response: Message | bytes | None

    def __init__(self, method: Method, rpc: RpcContext) -> None:
        super().__init__(method, rpc)
        self.peer = peer_of(rpc.peer())
        self.principal = None
        self.refusal = None
        self.examined = False
        self.waited_s = 0.0
        self.unlimited = method.unlimited
        self.request = None
        self.responded = False
        self.response = None

    @property
    def caller(self) -> str:
        """Whose limits apply: a name on credentials, or without these what a sender can't change at will."""
        return self.principal.name if self.principal else self.peer.address_prefix

    def remaining_s(self) -> float | None:
        """Returns the time until the caller's deadline; None without one."""
        return self.rpc.time_remaining()
