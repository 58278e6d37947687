"""A driver's lanes without a connection: what `console.client.drive_lanes` writes and reads on each."""

import asyncio
from collections import deque
from collections.abc import Callable
from typing import Any, Final, Protocol

from console.client import GatewayError
from console.client.errors import Cancelled
from practice.network import Network

_NEXT_S: Final = 1e-6
"""Between two messages: timers of the same instant have no order."""
_MOST_HELD: Final = 256
"""Messages that a cut network holds up; the oldest are lost."""


class Way:
    """One direction of the practice network. Messages never overtake one another, as on TCP.

    Args:
        network: returns how it treats a message now.
    """

    def __init__(self, network: Callable[[], Network]) -> None:
        self._network = network
        self._newest_s = 0.0
        self._held: deque[Callable[[], object]] = deque(maxlen=_MOST_HELD)

    def send(self, deliver: Callable[[], object]) -> None:
        """Has `deliver` called, in the running loop, when the message arrives."""
        self._held.append(deliver)
        self.go_on()

    def go_on(self) -> None:
        """Sends what the network has held up, as soon as it passes again."""
        loop = asyncio.get_running_loop()
        while self._held and (arrives_s := self._network().arrives_s(loop.time())) is not None:
            self._newest_s = max(arrives_s, self._newest_s + _NEXT_S)
            loop.call_at(self._newest_s, self._held.popleft())


class LaneOwner(Protocol):
    """The robot's end of a lane (`practice.session.PracticeSession`)."""

    def take(self, lane: "Lane", request: bytes) -> None:
        """Takes a request that the driver has written."""

    def leave(self, lane: "Lane", *, in_order: bool) -> None:
        """Takes the end of a lane: finished by the driver, or broken."""


class Lane:
    """The driver's end of a lane.

    Args:
        owner: the robot's end.
        up: from the driver to the robot.

    Attributes:
        session_id: of the session that it belongs to; empty until it is opened.
    """

    def __init__(self, owner: LaneOwner, up: Way) -> None:
        self.session_id = ""
        self._owner = owner
        self._up = up
        self._items: asyncio.Queue[Any] = asyncio.Queue()
        self._left = False

    async def write(self, request: bytes) -> None:
        """Sends a request; never waits."""
        self._up.send(lambda: self._owner.take(self, request))

    async def read(self) -> Any:
        """Returns the next item.

        Raises:
            GatewayError: the lane has ended.
        """
        item = await self._items.get()
        if isinstance(item, GatewayError):
            raise item
        return item

    async def finish(self) -> None:
        """Ends the requests; the robot then ends the lane."""
        self._leave(in_order=True)

    def cancel(self) -> None:
        """Ends the lane at once."""
        self._leave(in_order=False)

    def deliver(self, item: object) -> None:
        """Takes an item of the robot, or the `GatewayError` that ends the lane."""
        self._items.put_nowait(item)

    def _leave(self, *, in_order: bool) -> None:
        if not self._left:
            self._left = True
            self._up.send(lambda: self._owner.leave(self, in_order=in_order))


class LaneTransport:
    """Opens one lane, in the place of `console.client.transport.GrpcTransport`.

    Args:
        lane: what it opens.
    """

    def __init__(self, lane: Lane) -> None:
        self._lane = lane

    def open_both_ways(self, _method: object) -> Lane:
        """Returns the lane."""
        return self._lane

    async def close(self) -> None:
        """Ends the lane."""
        self._lane.cancel()
        self._lane.deliver(Cancelled("this lane was closed"))
