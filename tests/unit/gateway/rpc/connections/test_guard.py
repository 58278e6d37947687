"""Which connections the guard mutes: pending ones that have sent too much."""

from typing import Any

from gateway.config import LimitSettings
from gateway.rpc.calls.call import Peer, peer_of
from gateway.rpc.connections.admission import Admission
from gateway.rpc.connections.guard import PENDING_BYTES, ConnectionGuard

STRANGER, OPERATOR = "10.0.0.1:1000", "10.0.0.2:1000"


class Sockets:
    """Connections that have sent so many bytes."""

    def __init__(self) -> None:
        self.received = {STRANGER: 0, OPERATOR: 0}

    def received_bytes(self, address: str) -> int:
        return self.received[address]


class Ground:
    """A guard, an account with an operator in it, and connections without a kernel."""

    def __init__(self) -> None:
        self.admission = Admission(LimitSettings())
        self.sockets = Sockets()
        self._guard = ConnectionGuard(self.admission)
        self.admission.take_token(peer(OPERATOR))
        self.admission.admit(peer(OPERATOR))

    def flooding(self) -> list[str]:
        present = list(self.sockets.received)
        sockets: Any = self.sockets
        self.admission.surplus(present)
        return self._guard.flooding(sockets, present)


def peer(address: str) -> Peer:
    return peer_of(f"ipv4:{address}")


def test_a_stranger_is_muted_once_beyond_its_bytes() -> None:
    ground = Ground()
    ground.sockets.received[STRANGER] = PENDING_BYTES
    assert ground.flooding() == []
    ground.sockets.received[STRANGER] += 1
    assert ground.flooding() == [STRANGER]
    ground.sockets.received[STRANGER] *= 2
    assert ground.flooding() == []


def test_an_operator_may_send_as_much_as_it_likes() -> None:
    ground = Ground()
    ground.sockets.received[OPERATOR] = 100 * PENDING_BYTES
    assert ground.flooding() == []


def test_what_was_sent_before_access_was_lost_does_not_count() -> None:
    ground = Ground()
    ground.sockets.received[OPERATOR] = 100 * PENDING_BYTES
    ground.flooding()
    ground.admission.dismiss(peer(OPERATOR))
    assert ground.flooding() == []
    ground.sockets.received[OPERATOR] += PENDING_BYTES
    assert ground.flooding() == []
    ground.sockets.received[OPERATOR] += 1
    assert ground.flooding() == [OPERATOR]


def test_another_connection_of_the_same_address_begins_anew() -> None:
    ground = Ground()
    ground.sockets.received[STRANGER] = PENDING_BYTES + 1
    assert ground.flooding() == [STRANGER]
    del ground.sockets.received[STRANGER]
    ground.flooding()
    ground.sockets.received[STRANGER] = PENDING_BYTES
    assert ground.flooding() == []
    ground.sockets.received[STRANGER] += 1
    assert ground.flooding() == [STRANGER]
