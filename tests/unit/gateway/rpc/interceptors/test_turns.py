"""How many calls of a pending connection are examined at a time, and which connections flood."""

import asyncio
from typing import TYPE_CHECKING

import pytest

from gateway.config import LimitSettings
from gateway.rpc.calls.call import CallContext
from gateway.rpc.calls.methods import TELEOP
from gateway.rpc.connections.admission import Admission
from gateway.rpc.interceptors.turns import EXAMINED, FLOOD_S, FLOOD_WAITING, MAX_WAITING, TurnEnd, Turns
from tests.support.calls import PEER, call_of
from tests.support.clock import Clock

if TYPE_CHECKING:
    from collections.abc import Awaitable


class Ground:
    """Turns of an account of connections, and the calls that have arrived."""

    def __init__(self) -> None:
        self.clock = Clock()
        self.admission = Admission(LimitSettings(), self.clock)
        self.turns = Turns(self.admission, self.clock)

    def arrive(self, count: int = 1, peer: str = PEER) -> list["Arrived"]:
        return [Arrived(self.turns, call_of("GetSystemStatus", peer=peer)) for _ in range(count)]

    def admit(self, call: CallContext) -> None:
        self.admission.take_token(call.peer)
        self.admission.admit(call.peer)

    def floods(self, peer: str = PEER) -> bool:
        address = call_of(peer=peer).peer.address
        self.admission.surplus([address])
        return self.admission.floods(address)


class Arrived:
    """A call that has a turn, or waits for one."""

    def __init__(self, turns: Turns, call: CallContext) -> None:
        self.call = call
        self._turns = turns
        waiting: Awaitable[None] | None = turns.on_call(call)
        self.task = None if waiting is None else asyncio.ensure_future(waiting)

    @property
    def waits(self) -> bool:
        return self.task is not None and not self.task.done()

    def refuse(self) -> None:
        self._turns.on_end(self.call, None)


@pytest.fixture
def ground() -> Ground:
    return Ground()


async def settle() -> None:
    for _ in range(4):
        await asyncio.sleep(0)


async def leave(arrived: list[Arrived]) -> None:
    for each in arrived:
        if each.task:
            each.task.cancel()
    await asyncio.gather(*(each.task for each in arrived if each.task), return_exceptions=True)


async def test_a_few_calls_are_examined_and_the_others_wait_in_order(ground: Ground) -> None:
    arrived = ground.arrive(EXAMINED + 3)
    await settle()
    assert [each.waits for each in arrived] == [False] * EXAMINED + [True] * 3
    ground.clock.now_s += 0.5
    arrived[0].refuse()
    await settle()
    assert [each.waits for each in arrived[EXAMINED:]] == [False, True, True]
    assert arrived[EXAMINED].call.waited_s == 0.5
    assert arrived[0].call.waited_s == 0
    await leave(arrived)


async def test_all_go_on_when_the_connection_is_admitted(ground: Ground) -> None:
    arrived = ground.arrive(100)
    await settle()
    ground.admit(arrived[0].call)
    TurnEnd(ground.turns).on_call(arrived[0].call)
    await settle()
    assert not any(each.waits for each in arrived)
    for each in arrived:
        each.refuse()
    assert not any(each.waits for each in ground.arrive(100)), "and no further one waits"
    assert vars(ground.turns)["_queues"] == {}


async def test_connections_do_not_wait_for_each_other(ground: Ground) -> None:
    strangers = ground.arrive(50)
    (operator,) = ground.arrive(peer="ipv4:10.0.0.6:1")
    assert not operator.waits
    await leave(strangers)


async def test_a_call_that_is_admitted_gives_its_turn_back_once(ground: Ground) -> None:
    """It ends later, maybe as a stream."""
    arrived = ground.arrive(EXAMINED + 2)
    await settle()
    TurnEnd(ground.turns).on_call(arrived[0].call)
    arrived[0].refuse()
    await settle()
    assert [each.waits for each in arrived[EXAMINED:]] == [False, True]
    await leave(arrived)


async def test_a_caller_that_leaves_while_it_waits_is_forgotten(ground: Ground) -> None:
    arrived = ground.arrive(EXAMINED + 2)
    await settle()
    await leave(arrived[EXAMINED : EXAMINED + 1])
    arrived[0].refuse()
    await settle()
    assert not arrived[-1].waits
    for each in [*arrived[1:EXAMINED], arrived[-1]]:
        each.refuse()
    assert vars(ground.turns)["_queues"] == {}
    assert vars(ground.turns)["_waiting"] == 0


async def test_a_turn_is_not_lost_with_a_caller_that_leaves_as_it_comes(ground: Ground) -> None:
    arrived = ground.arrive(EXAMINED + 2)
    await settle()
    arrived[0].refuse()
    leaving = arrived[EXAMINED]
    assert leaving.task
    leaving.task.cancel()
    await settle()
    assert leaving.task.cancelled()
    assert not arrived[-1].waits
    await leave(arrived)


async def test_callers_that_leave_together_disturb_no_turn(ground: Ground) -> None:
    """As when their connection breaks: a turn comes to one that has left and does not know it yet."""
    arrived = ground.arrive(EXAMINED + 3)
    await settle()
    for each in arrived[EXAMINED : EXAMINED + 2]:
        assert each.task
        each.task.cancel()
    arrived[0].refuse()
    await settle()
    assert not arrived[-1].waits, "the turn is that of the one that stays"
    for each in [*arrived[1:EXAMINED], arrived[-1]]:
        each.refuse()
    assert vars(ground.turns)["_queues"] == {}
    assert vars(ground.turns)["_waiting"] == 0


async def test_a_stop_never_waits(ground: Ground) -> None:
    arrived = ground.arrive(20)
    assert ground.turns.on_call(call_of("StopRobot", service=TELEOP.full_name)) is None
    await leave(arrived)


async def test_a_stop_of_an_unknown_caller_waits_like_any_other_call(ground: Ground) -> None:
    arrived = ground.arrive(EXAMINED)
    stop = call_of("StopRobot", service=TELEOP.full_name)
    stop.unlimited = False
    stopping = Arrived(ground.turns, stop)
    await settle()
    assert stopping.waits
    await leave([*arrived, stopping])


async def test_a_unix_socket_has_no_turns(ground: Ground) -> None:
    assert not any(each.waits for each in ground.arrive(100, peer="unix:/run/gateway.sock"))


async def test_a_connection_of_which_many_calls_wait_for_long_floods(ground: Ground) -> None:
    arrived = ground.arrive(EXAMINED + FLOOD_WAITING + 1)
    await settle()
    ground.clock.now_s += FLOOD_S - 0.1
    arrived[0].refuse()
    assert not ground.floods()
    ground.clock.now_s += 0.1
    arrived += ground.arrive(1)
    await settle()
    assert ground.floods()
    assert ground.admission.connect_policy().blocked == {"10.0.0.5"}
    await leave(arrived)


async def test_one_whose_calls_become_fewer_does_not(ground: Ground) -> None:
    arrived = ground.arrive(EXAMINED + FLOOD_WAITING)
    await settle()
    ground.clock.now_s += FLOOD_S - 0.1
    arrived[0].refuse()
    ground.clock.now_s += 0.1
    arrived += ground.arrive(1)
    await settle()
    ground.clock.now_s += FLOOD_S - 0.1
    arrived[1].refuse()
    assert not ground.floods()
    await leave(arrived)


async def test_with_too_many_calls_in_all_the_connection_with_most_floods(ground: Ground) -> None:
    peers = [f"ipv4:10.0.1.{number}:1" for number in range(6)]
    arrived = ground.arrive(EXAMINED + 200, peer=peers[0])
    for peer in peers[1:]:
        arrived += ground.arrive(EXAMINED + 150, peer=peer)
    await settle()
    assert ground.admission.connect_policy().blocked == frozenset(), "950 wait"
    arrived += ground.arrive(MAX_WAITING - 950 + EXAMINED, peer="ipv4:10.0.2.1:1")
    await settle()
    assert ground.admission.connect_policy().blocked == frozenset()
    arrived += ground.arrive(1, peer="ipv4:10.0.2.1:1")
    await settle()
    assert ground.admission.connect_policy().blocked == {"10.0.1.0"}
    await leave(arrived)
    assert vars(ground.turns)["_waiting"] == 0
