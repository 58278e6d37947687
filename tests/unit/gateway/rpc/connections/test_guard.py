"""Which connections the guard throttles, and which it cuts off: pending ones that have sent too much."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from common.tasks import cancel
from gateway.config import LimitSettings
from gateway.rpc.calls.call import Peer, peer_of
from gateway.rpc.connections.accepted_sockets import UNLIMITED
from gateway.rpc.connections.admission import Admission
from gateway.rpc.connections.guard import (
    OVERRUN_BYTES,
    PENDING_BYTES,
    PLACED_BYTES_PER_S,
    THROTTLED_BYTES_PER_S,
    UNTHROTTLED_BYTES,
    ConnectionGuard,
)
from gateway.rpc.connections.packet_filter import ConnectPolicy
from gateway.rpc.connections.shedding import BURST, RAISE_FACTOR
from tests.support.clock import Clock
from tests.support.eventually import eventually

STRANGER, OPERATOR = "10.0.0.1:1000", "10.0.0.2:1000"
NEIGHBOUR = "10.0.0.2:2000"
"""A stranger at the operator's address."""
THROTTLED, RELEASED = (STRANGER, THROTTLED_BYTES_PER_S), (STRANGER, UNLIMITED)


class Sockets:
    """Connections that have sent so many bytes, and what was done to them."""

    def __init__(self, *, mutes: bool = True) -> None:
        self.received = {STRANGER: 0, OPERATOR: 0}
        self.throttled: list[tuple[str, int]] = []
        self.muted: list[str] = []
        self.closed: list[str] = []
        self.applied: list[ConnectPolicy] = []
        self._mutes = mutes

    def received_bytes(self, address: str) -> int:
        return self.received[address]

    def throttle(self, address: str, bytes_per_s: int) -> None:
        self.throttled.append((address, bytes_per_s))

    def mute(self, address: str) -> bool:
        if self._mutes:
            self.muted.append(address)
        return self._mutes

    def scan(self) -> list[str]:
        return list(self.received)

    def apply(self, policy: ConnectPolicy) -> bool:
        self.applied.append(policy)
        return self._mutes

    def close(self, address: str) -> bool:
        self.closed.append(address)
        del self.received[address]
        return True


class Ground:
    """A guard, an account with an operator in it, and connections without a kernel."""

    def __init__(self, *, mutes: bool = True, clock: Callable[[], float] = time.monotonic) -> None:
        self.admission = Admission(LimitSettings())
        self.sockets = Sockets(mutes=mutes)
        self.guard = ConnectionGuard(self.admission, clock)
        self.admit(OPERATOR)

    def admit(self, address: str) -> None:
        self.admission.take_token(peer(address))
        self.admission.admit(peer(address))

    def look(self, **received: int) -> None:
        self.sockets.received.update({globals()[name]: count for name, count in received.items()})
        sockets: Any = self.sockets
        self.guard.look(sockets)


@pytest.fixture
def ground() -> Ground:
    return Ground()


def peer(address: str) -> Peer:
    return peer_of(f"ipv4:{address}")


def test_a_stranger_is_throttled_once_beyond_its_bytes(ground: Ground) -> None:
    ground.look(STRANGER=UNTHROTTLED_BYTES)
    assert ground.sockets.throttled == []
    ground.look(STRANGER=UNTHROTTLED_BYTES + 1)
    ground.look(STRANGER=2 * UNTHROTTLED_BYTES)
    assert ground.sockets.throttled == [THROTTLED]
    assert ground.guard.throttled == 1


def test_it_is_answered_at_full_speed_once_it_is_admitted(ground: Ground) -> None:
    ground.look(STRANGER=2 * UNTHROTTLED_BYTES)
    ground.admit(STRANGER)
    ground.look()
    ground.look()
    assert ground.sockets.throttled == [THROTTLED, RELEASED]


def test_a_stranger_is_closed_and_its_address_blocked_beyond_many_more(ground: Ground) -> None:
    ground.look(STRANGER=PENDING_BYTES)
    assert ground.sockets.closed == []
    ground.look(STRANGER=PENDING_BYTES + 1)
    ground.look()
    assert ground.sockets.closed == [STRANGER]
    assert ground.sockets.applied == [ConnectPolicy(frozenset({"10.0.0.1"}))], "applied once"
    assert (ground.guard.muted, ground.guard.closed, len(ground.guard.policy.blocked)) == (0, 1, 1)


def test_one_that_may_share_its_address_with_an_operator_is_muted(ground: Ground) -> None:
    ground.sockets.received[NEIGHBOUR] = 0
    ground.look(NEIGHBOUR=PENDING_BYTES)
    assert ground.sockets.muted == []
    ground.look(NEIGHBOUR=PENDING_BYTES + 1)
    ground.look(NEIGHBOUR=2 * PENDING_BYTES)
    assert ground.sockets.muted == [NEIGHBOUR]
    assert (ground.guard.muted, ground.guard.closed, len(ground.guard.policy.blocked)) == (1, 0, 0)


def test_where_the_kernel_does_not_permit_it_the_stranger_is_closed() -> None:
    ground = Ground(mutes=False)
    ground.sockets.received[NEIGHBOUR] = 0
    ground.look(STRANGER=PENDING_BYTES + 1, NEIGHBOUR=PENDING_BYTES + 1)
    ground.look()
    assert ground.sockets.closed == [STRANGER, NEIGHBOUR]
    assert (ground.guard.muted, ground.guard.closed) == (0, 2)


def test_amid_a_rush_a_stranger_may_send_less(ground: Ground) -> None:
    ground.look(STRANGER=OVERRUN_BYTES + 1)
    assert ground.sockets.closed == []
    ground.sockets.received.update({f"10.1.{number}.1:1": 0 for number in range(BURST)})
    ground.look()
    assert STRANGER in ground.sockets.closed
    assert ground.guard.policy.one_in == RAISE_FACTOR


def test_an_operator_may_send_as_much_as_it_likes(ground: Ground) -> None:
    ground.look(OPERATOR=100 * PENDING_BYTES)
    assert (ground.sockets.throttled, ground.sockets.muted) == ([], [])


def test_what_was_sent_before_access_was_lost_does_not_count(ground: Ground) -> None:
    before = 100 * PENDING_BYTES
    ground.look(OPERATOR=before)
    ground.admission.dismiss(peer(OPERATOR))
    ground.look(OPERATOR=before)
    ground.look(OPERATOR=before + UNTHROTTLED_BYTES)
    assert (ground.sockets.throttled, ground.sockets.muted) == ([], [])
    ground.look(OPERATOR=before + PENDING_BYTES + 1)
    assert ground.sockets.muted == [OPERATOR]


def test_another_connection_of_the_same_address_begins_anew(ground: Ground) -> None:
    ground.look(NEIGHBOUR=PENDING_BYTES + 1)
    del ground.sockets.received[NEIGHBOUR]
    ground.look()
    ground.look(NEIGHBOUR=PENDING_BYTES)
    assert ground.sockets.muted == [NEIGHBOUR]
    ground.look(NEIGHBOUR=PENDING_BYTES + 1)
    assert ground.sockets.muted == [NEIGHBOUR, NEIGHBOUR]


def test_a_stranger_that_floods_is_closed_and_its_address_blocked(ground: Ground) -> None:
    ground.look()
    ground.admission.note_flood(STRANGER)
    ground.look()
    ground.look()
    assert ground.sockets.closed == [STRANGER]
    assert ground.sockets.applied == [ConnectPolicy(frozenset({"10.0.0.1"}))]
    assert len(ground.guard.policy.blocked) == 1


def test_a_block_ends(ground: Ground) -> None:
    ground.admission.note_flood(STRANGER)
    ground.look()
    ground.admit(STRANGER)
    ground.look()
    assert ground.sockets.applied == [ConnectPolicy(frozenset({"10.0.0.1"})), ConnectPolicy()]
    assert len(ground.guard.policy.blocked) == 0


def test_where_the_kernel_does_not_permit_it_no_address_is_blocked() -> None:
    ground = Ground(mutes=False)
    ground.look()
    ground.admission.note_flood(STRANGER)
    ground.look()
    assert ground.sockets.closed == [STRANGER]
    assert len(ground.guard.policy.blocked) == 0


def test_a_caller_that_sends_too_much_in_a_second_is_throttled_until_it_sends_less() -> None:
    clock = Clock()
    ground = Ground(clock=clock)
    ground.look()
    ground.look(OPERATOR=PLACED_BYTES_PER_S)
    assert ground.sockets.throttled == []
    ground.look(OPERATOR=PLACED_BYTES_PER_S + 1)
    ground.look(OPERATOR=2 * PLACED_BYTES_PER_S)
    throttled, released = (OPERATOR, THROTTLED_BYTES_PER_S), (OPERATOR, UNLIMITED)
    assert ground.sockets.throttled == [throttled], "at once, and once"
    clock.now_s += 1
    ground.look(OPERATOR=3 * PLACED_BYTES_PER_S)
    clock.now_s += 1
    ground.look(OPERATOR=4 * PLACED_BYTES_PER_S)
    assert ground.sockets.throttled == [throttled, released]
    for second in range(5, 20):
        clock.now_s += 1
        ground.look(OPERATOR=second * PLACED_BYTES_PER_S)
    assert ground.sockets.throttled == [throttled, released]


def test_a_caller_whose_calls_flood_is_muted_and_others_at_its_address_are_not_blocked(
    ground: Ground,
) -> None:
    ground.look()
    ground.admission.note_flood(OPERATOR)
    ground.look()
    ground.look()
    assert ground.sockets.muted == [OPERATOR]
    assert ground.guard.policy.blocked == frozenset()


def seen_by(guard: ConnectionGuard) -> Callable[[], Awaitable[int]]:
    async def seen() -> int:
        return guard.open

    return seen


async def test_a_connection_is_looked_at_as_it_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not at the next of the looks that come anyway, of which there is none here."""
    monkeypatch.setattr("gateway.rpc.connections.guard.SCAN_EVERY_S", 3600.0)
    guard = ConnectionGuard(Admission(LimitSettings()))

    async def until_closed(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read()
        writer.close()

    async with await asyncio.start_server(until_closed, "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        guarding = asyncio.create_task(guard.run(port))
        try:
            await asyncio.sleep(0)  # the first look finds none
            _, writer = await asyncio.open_connection("127.0.0.1", port)
            await eventually(seen_by(guard), bool, "the connection is seen")
            writer.close()
        finally:
            await cancel([guarding])


async def test_while_there_are_newcomers_it_looks_without_being_called(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What they send, no arrival shows."""
    monkeypatch.setattr("gateway.rpc.connections.guard.SCAN_EVERY_S", 3600.0)
    admission = Admission(LimitSettings())
    monkeypatch.setattr("gateway.rpc.connections.admission.NEWCOMER_S", 3600.0)
    admission.surplus([STRANGER])
    guard = ConnectionGuard(admission)
    looks: asyncio.Queue[None] = asyncio.Queue()
    monkeypatch.setattr(guard, "look", lambda _sockets: looks.put_nowait(None))
    guarding = asyncio.create_task(guard.run(1))
    try:
        for _ in range(3):
            await looks.get()
    finally:
        await cancel([guarding])
