"""Turns: few calls of a connection without an admitted one, or of one in excess, are examined at a time.

To refuse a call costs nearly as much as to answer it, but to let it wait costs next to nothing. So a stranger
that opens all the calls that a connection may have takes no more of the gateway than one that opens a few.
"""

import asyncio
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Final

from common.interceptors import Interceptor
from gateway.rpc.calls.call import CallContext
from gateway.rpc.connections.admission import Admission

EXAMINED: Final = 8
"""Calls of one restrained connection that are examined at a time, the delay of their refusal included."""
FLOOD_WAITING: Final = 64
FLOOD_S: Final = 5.0
"""With so many calls waiting for so long, a connection floods: in that time 80 have been refused."""
MAX_WAITING: Final = 1024
"""Calls that wait, over all connections. With more of them, the connection with most floods."""


@dataclass(slots=True)
class _Queue:
    """The calls of one restrained connection.

    Attributes:
        address: the connection's `Peer.address`.
        examined: how many have a turn.
        waiting: those that have none yet, in the order in which they came.
        long_since_s: since when FLOOD_WAITING or more wait; None if they are fewer.
        floods: whether it was reported.
    """

    address: str
    examined: int = 0
    waiting: "dict[asyncio.Future[None], None]" = field(default_factory=dict)
    long_since_s: float | None = None
    floods: bool = False


class Turns(Interceptor[CallContext]):
    """Makes calls of restrained connections wait for their turn; others, and stops of known callers, pass.

    When a connection is admitted, all its calls go on at once. Used on one event loop.

    Args:
        admission: knows which connections are restrained, and gets to know which flood.
        clock: seconds, monotonic.
    """

    def __init__(self, admission: Admission, clock: Callable[[], float] = time.monotonic) -> None:
        self._admission = admission
        self._clock = clock
        self._queues: dict[str, _Queue] = {}
        """By `Peer.address`; of connections with a call that has a turn."""
        self._waiting = 0
        """Calls, over all connections that were not reported."""

    def on_call(self, call: CallContext) -> Awaitable[None] | None:
        """Takes a turn; returns an awaitable if there is none yet."""
        if call.unlimited or not self._admission.is_restrained(call.peer):
            return None
        address = call.peer.address
        queue = self._queues.get(address)
        if queue is None:
            queue = self._queues[address] = _Queue(address)
        if queue.examined >= EXAMINED:
            return self._wait(call, queue)
        queue.examined += 1
        call.examined = True
        return None

    def on_end(self, call: CallContext, _error: BaseException | None) -> None:
        """Ends the turn of a call that was refused."""
        self.end_turn(call)

    def end_turn(self, call: CallContext) -> None:
        """Gives the call's turn, if it has one, to those that wait."""
        if not call.examined:
            return
        call.examined = False
        address = call.peer.address
        queue = self._queues[address]
        queue.examined -= 1
        restrained = self._admission.is_restrained(call.peer)
        while queue.waiting and (queue.examined < EXAMINED or not restrained):
            turn = next(iter(queue.waiting))
            self._remove(turn, queue)
            if turn.cancelled():
                continue  # its caller has left, which `_wait` is about to notice
            turn.set_result(None)
            queue.examined += 1
        self._judge(queue)
        if not queue.examined:
            del self._queues[address]

    async def _wait(self, call: CallContext, queue: _Queue) -> None:
        began_s = self._clock()
        turn: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        queue.waiting[turn] = None
        self._waiting += not queue.floods
        self._judge(queue)
        try:
            await turn
        except asyncio.CancelledError:
            if turn in queue.waiting:
                self._remove(turn, queue)
            elif not turn.cancelled():  # its caller has left in the moment when its turn came
                call.examined = True
                self.end_turn(call)
            raise
        call.examined = True
        call.waited_s = self._clock() - began_s

    def _remove(self, turn: "asyncio.Future[None]", queue: _Queue) -> None:
        del queue.waiting[turn]
        self._waiting -= not queue.floods

    def _judge(self, queue: _Queue) -> None:
        """Reports connections that flood."""
        now_s = self._clock()
        if len(queue.waiting) < FLOOD_WAITING:
            queue.long_since_s = None
        elif queue.long_since_s is None:
            queue.long_since_s = now_s
        elif now_s - queue.long_since_s >= FLOOD_S:
            self._report(queue)
        if self._waiting > MAX_WAITING:
            self._report(max(self._queues.values(), key=lambda each: 0 if each.floods else len(each.waiting)))

    def _report(self, queue: _Queue) -> None:
        if not queue.floods:
            queue.floods = True
            self._waiting -= len(queue.waiting)
            self._admission.note_flood(queue.address)


class TurnEnd(Interceptor[CallContext]):
    """Ends the turn of a call that was not refused: what follows may last as long as a stream."""

    def __init__(self, turns: Turns) -> None:
        self._turns = turns

    def on_call(self, call: CallContext) -> None:
        """Ends the call's turn."""
        self._turns.end_turn(call)
