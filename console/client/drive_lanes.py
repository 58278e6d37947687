"""The connections of a driver's session: each command goes out on all of them, and the first copy counts."""

import asyncio
import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol, TypeAlias

from common.backoff import Backoff
from common.broadcast import Broadcast
from common.tasks import cancel
from console.client.errors import GatewayError, GatewayFailed, Overloaded, Refused, Unreachable
from console.client.mapping.driving import join_request, open_request
from console.client.mapping.methods import DRIVE, Method
from console.client.results import DriveOpened, DriveState, Supervision

MAX_UNACKNOWLEDGED: Final = 10
"""Commands on their way on one lane; what would queue behind them is too old to count. A release passes."""
MAX_UNANSWERED: Final = 100
"""Commands on one lane since its last state: it has stood still for 2 s. What it holds, with a release that
has passed, must not come as more at once than the gateway takes (200)."""
LANES: Final = 3
"""Of a session, unless the gateway takes fewer. A lost packet may hold a lane up for longer than a command is
valid: in an hour of virtual time on a link that loses 10 %, two lanes at once stopped a driver 13 times,
three not once (the model of tests/unit/console/client/test_lossy_lanes.py, seeds 1 to 6); on real
connections, two did so eight times in ten minutes, three not once (`drive.false_stops_very_lossy`)."""
_LANES_UNSAID: Final = 2
"""What a gateway takes that does not say."""
_ALL_OPEN_S: Final = 2.5
"""How long the opening waits for all lanes: a lost first packet of a connection comes again after 1 s, and
when that is lost, too, in another attempt (RFC 6298 2.1)."""
_FIRST_PAUSE_S: Final = 0.1
_LONGEST_PAUSE_S: Final = 1.0
_REJOINS: Final = 3

LaneItem: TypeAlias = DriveOpened | DriveState | None


class Lane(Protocol):
    """One lane, open; `console.client.transport.Duplex` is one. Its end raises a `GatewayError`."""

    async def write(self, request: bytes) -> None:
        """Sends a request."""

    async def read(self) -> LaneItem:
        """Returns the next item."""

    async def finish(self) -> None:
        """Ends the requests; the robot then ends the lane."""

    def cancel(self) -> None:
        """Ends the lane at once."""


class LaneTransport(Protocol):
    """Opens one lane; `console.client.transport.GrpcTransport` can."""

    def open_both_ways(self, method: Method[LaneItem]) -> Lane:
        """Returns the lane."""

    async def close(self) -> None:
        """Ends it."""


@dataclass(frozen=True, slots=True)
class Opening:
    """What the first lane says.

    Attributes:
        client_name: The driver's program; the other lanes say it, too.
        supervision: How the driver sees the robot.
        take_over: Whether to take the lease from another driver.
        within_s: Deadline of the opening.
    """

    client_name: str
    supervision: Supervision
    take_over: bool
    within_s: float


@dataclass(frozen=True, slots=True)
class Outgoing:
    """A command on its way out.

    Attributes:
        sequence: 0 before the first.
        held: Whether it holds.
        request: In the schema's form.
        last: Whether the lanes end behind it.
    """

    sequence: int = 0
    held: bool = False
    request: bytes = b""
    last: bool = False


class LaneUser(Protocol):
    """The session: what happens on any lane."""

    def opened(self, opened: DriveOpened) -> None:
        """The robot has given the lease."""

    def received(self, state: DriveState) -> None:
        """A state has arrived; another lane may have been faster."""

    def left(self, command: Outgoing) -> None:
        """A command has left."""

    def lost(self, error: GatewayError) -> None:
        """The last lane has ended, before the last command."""


class Lanes:
    """Opens the lanes and keeps them open as long as one of them is: the last one's end is the session's.

    Args:
        connect: Opens a connection for one lane.
        opening: What the first one says.
        user: The session.
        changes: Notified when a lane has opened or ended.
    """

    def __init__(
        self, connect: Callable[[], LaneTransport], opening: Opening, user: LaneUser, changes: Broadcast
    ) -> None:
        self._connect = connect
        self._opening = opening
        self._user = user
        self._changes = changes
        self._commands = Broadcast()
        self._newest = Outgoing()
        self._session_id = ""
        self._lost = False
        self._keepers: list[asyncio.Task[None]] = []
        self._written: list[OnTheirWay] = []
        """Of the open lanes."""
        self._count = LANES
        self.open_count = 0

    async def open_first(self) -> None:
        """Opens the first lane.

        Raises:
            GatewayError: The robot refuses, or does not answer.
        """
        self._start_keeping(await self._first_lane())

    async def open_others(self) -> None:
        """Opens the others, and waits for them, not for long.

        One alone stands still whenever a packet is lost, and stops the robot without need.
        """
        for _ in range(1, self._count):
            self._start_keeping(None)
        await self._changes.wait_until(lambda: self.open_count == self._count or self._lost, _ALL_OPEN_S)

    def send(self, command: Outgoing) -> None:
        """Sends a command on every lane; one that a lane has not written yet is skipped there."""
        self._newest = command
        self._commands.notify_all()

    async def close(self) -> None:
        """Ends all lanes at once."""
        # Forgotten: each has the traceback of its end, and with it its lane, whose connection would stay open
        # until Python's collector comes.
        keepers, self._keepers = self._keepers, []
        await cancel(keepers)

    async def _first_lane(self) -> tuple[LaneTransport, Lane]:
        opening = self._opening
        request = open_request(opening.client_name, opening.supervision, take_over=opening.take_over)
        deadline_s = time.monotonic() + opening.within_s
        backoff = Backoff(_FIRST_PAUSE_S, _LONGEST_PAUSE_S)
        while True:
            left_s = deadline_s - time.monotonic()
            try:
                return await self._open(request, left_s)
            except Unreachable:
                # The first packet of a connection, when lost, is sent again only after 1 s (RFC 6298 2.1): as
                # long as gRPC lets an attempt take.
                pause_s = backoff.next_s()
                if time.monotonic() + pause_s >= deadline_s:
                    raise
            await asyncio.sleep(pause_s)

    async def _open(self, request: bytes, within_s: float) -> tuple[LaneTransport, Lane]:
        transport = self._connect()
        try:
            async with asyncio.timeout(within_s):
                lane = transport.open_both_ways(DRIVE)
                await lane.write(request)
                opened = await lane.read()
        except TimeoutError:
            await transport.close()
            raise Unreachable(f"no lane was opened within {within_s:.1f} s") from None
        except BaseException:
            await transport.close()
            raise
        if isinstance(opened, DriveOpened):
            self._session_id = opened.session_id
            self._count = min(LANES, opened.max_lanes or _LANES_UNSAID)
            self._user.opened(opened)
        return transport, lane

    def _start_keeping(self, opened: tuple[LaneTransport, Lane] | None) -> None:
        name = f"drive lane {len(self._keepers) + 1}"
        self._keepers.append(asyncio.create_task(self._keep(opened), name=name))

    async def _keep(self, opened: tuple[LaneTransport, Lane] | None) -> None:
        """Keeps one lane open until the last command, or until no lane is."""
        backoff = Backoff(_FIRST_PAUSE_S, _LONGEST_PAUSE_S)
        while not self._newest.last and not self._lost:
            try:
                request = join_request(self._opening.client_name, self._session_id)
                transport, lane = opened or await self._open(request, self._opening.within_s)
                backoff.reset()
                await self._serve(transport, lane)
            except GatewayError as error:
                # Where the gateway ends a call while a command is written, gRPC's asyncio client makes up an
                # internal error. If the session has ended, the gateway says why when it is joined again.
                made_up = isinstance(error, GatewayFailed) and backoff.failures < _REJOINS
                # One that has no room for another lane, or takes this one for open still, keeps the session.
                refused = isinstance(error, Refused) and not isinstance(error, Overloaded)
                if refused or (self.open_count == 0 and not made_up):
                    self._lose(error)
                    return
            opened = None
            await asyncio.sleep(backoff.next_s())

    async def _serve(self, transport: LaneTransport, lane: Lane) -> None:
        """Writes commands and reads states.

        Raises:
            GatewayError: The lane has ended.
        """
        on_their_way = OnTheirWay()
        self._written.append(on_their_way)
        self.open_count += 1
        self._changes.notify_all()
        writer = asyncio.create_task(self._write(lane, on_their_way), name="drive lane, commands")
        try:
            while True:
                item = await lane.read()
                if isinstance(item, DriveState):
                    on_their_way.answered()
                    for each in self._written:
                        each.acknowledge(item.newest_sequence)
                    self._user.received(item)
        finally:
            self._written.remove(on_their_way)
            self.open_count -= 1
            await cancel([writer])
            lane.cancel()
            await transport.close()
            self._changes.notify_all()

    async def _write(self, lane: Lane, on_their_way: "OnTheirWay") -> None:
        """Writes the newest command whenever there is a new one; those in between are skipped."""
        seen = 0
        while True:
            await self._commands.wait_until(lambda: self._newest.sequence > seen)  # noqa: B023  # read at once
            command = self._newest
            seen = command.sequence
            if not (on_their_way.has_room(held=command.held) or command.last):
                continue
            on_their_way.add(seen, held=command.held)
            with contextlib.suppress(GatewayError):  # The reader finds out why the lane has ended.
                await lane.write(command.request)
                self._user.left(command)
                if command.last:
                    await lane.finish()
                    return

    def _lose(self, error: GatewayError) -> None:
        if not self._lost and not self._newest.last:
            self._lost = True
            self._user.lost(error)
        self._changes.notify_all()


class OnTheirWay:
    """The commands that were written on one lane and are not acknowledged yet.

    A state on any lane acknowledges. A lane that counted only its own would fall silent whenever a lost
    packet holds its states up, and leave the robot to the other one alone.

    A lane is also full when only the states are held up: a release that waited for them would let the robot
    go on by the commands that have arrived. So the first command that does not hold, after one that did,
    always has room; those behind it wait, and with them the next hold.
    """

    def __init__(self) -> None:
        self._sequences: list[int] = []
        self._unanswered = 0
        self._held = False
        """Whether the newest of them holds."""

    def has_room(self, *, held: bool) -> bool:
        """Whether another command has room; one that would only queue behind these has none.

        Args:
            held: whether it holds.
        """
        if self._held and not held:
            return True
        return len(self._sequences) < MAX_UNACKNOWLEDGED and self._unanswered < MAX_UNANSWERED

    def add(self, sequence: int, *, held: bool) -> None:
        """Adds a command that is written now."""
        self._sequences.append(sequence)
        self._unanswered += 1
        self._held = held

    def answered(self) -> None:
        """Notes that a state has come on this lane."""
        self._unanswered = 0

    def acknowledge(self, newest: int) -> None:
        """Removes what the robot has received: all commands up to the newest, on whichever lane it came."""
        self._sequences = [each for each in self._sequences if each > newest]
