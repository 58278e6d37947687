"""A driver's session: hold to run, over two lanes, and no way to forget the stop.

Commands go out 50 times a second, whether the driver holds or not, each on two connections; the copy that
arrives first counts. Each says until when it is valid on the robot's clock: the newest instant that the robot
has sent, plus the time since it arrived, plus 250 ms. So a command that was held up on its way moves nothing,
whatever the two clocks show.
"""

import asyncio
import contextlib
import math
import time
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Final, Protocol, Self, TypeAlias

from common.backoff import Backoff
from common.broadcast import Broadcast
from common.tasks import cancel
from common.version import project_version
from console.client.errors import GatewayError, GatewayFailed, Refused, Unreachable
from console.client.mapping.driving import DriveCommand, command_request, join_request, open_request
from console.client.mapping.methods import DRIVE, Method
from console.client.results import (
    DriveInhibit,
    DriveLimits,
    DriveOpened,
    DrivePhase,
    DriveState,
    StopLatch,
    Supervision,
)

HOLD_COUNTS_S: Final = 0.1
"""A hold that is not renewed for this long is a release: the program that reads the driver's hands hangs.
When it goes on, its driver has to release and to hold again: no recovery of a program moves the robot."""
VALID_S: Final = 0.25
"""Longest validity of a command after the echoed instant has arrived."""
COMMANDS_PER_S: Final = 50
MAX_UNACKNOWLEDGED: Final = 10
"""Commands on their way on one lane; what would queue behind them is too old to count."""
LANES: Final = 2
_LANES_S: Final = 2.5
"""How long the opening waits for all lanes: a lost first packet of a connection comes again after 1 s, and
when that is lost, too, in another attempt (RFC 6298 2.1)."""
_FAREWELL_S: Final = 0.3
"""How long the end of a session waits for its last release to arrive."""
_FIRST_PAUSE_S: Final = 0.1
_LONGEST_PAUSE_S: Final = 1.0
_REJOINS: Final = 3
_NS_PER_S: Final = 1_000_000_000


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
class DriveOptions:
    """How a session is opened.

    Attributes:
        take_over: Whether to take the lease from another driver.
        supervision: How the driver sees the robot.
        picture: Returns when the picture that the driver sees now was captured, in ns of the robot's
            monotonic clock; None without one. Called 50 times a second in the session's loop; must not wait.
        input_device: What the driver steers with, for the robot's audit log; `hold` may name another.
        client_name: The driver's program, for the same.
    """

    take_over: bool = False
    supervision: Supervision = Supervision.PICTURE
    picture: Callable[[], int | None] | None = None
    input_device: str = "program"
    client_name: str = ""


@dataclass(frozen=True, slots=True)
class _Hold:
    vx_mps: float
    vy_mps: float
    wz_rad_s: float
    input_device: str
    at_s: float


class DriveSession:
    """A lease and its lanes, while the `async with` block lasts; its end is a release.

    `hold` and `release` may be called from any thread, all else in the session's loop.

    Args:
        connect: Opens a connection for one lane.
        options: How to open the session.
        opens_within_s: Deadline of the opening.

    Attributes:
        limits: What the robot accepts.
        state: The robot's newest; None before the first.
    """

    def __init__(
        self, connect: Callable[[], LaneTransport], options: DriveOptions, opens_within_s: float
    ) -> None:
        self._connect = connect
        self._options = options
        self._opens_within_s = opens_within_s
        self._name = options.client_name or f"robotctl {project_version()}"
        self._hold: _Hold | None = None
        self._lapsed = False
        """Whether the hold was not renewed in time; until a release, no other counts."""
        self._let_go = False
        """Whether the driver has released since the last command was made; it is then no hold in any case."""
        self._released = True
        """Whether a command that is no hold has left since the last hold: only then a new one begins."""
        self._sequence = 0
        self._command = b""
        self._command_holds = False
        self._armed_at = 0
        """The newest command when the robot said that it was armed."""
        self._echo: tuple[int, float] = 0, 0.0
        """The newest instant of the robot, in ns, and when it arrived here."""
        self._changes = Broadcast()
        self._sends = Broadcast()
        self._session_id = ""
        self._open_lanes = 0
        self._ending = False
        self._error: GatewayError | None = None
        self._tasks: list[asyncio.Task[None]] = []
        self._loop: asyncio.AbstractEventLoop | None = None
        self.limits: DriveLimits | None = None
        self.state: DriveState | None = None

    async def __aenter__(self) -> Self:
        """Opens the session; on a bad network, with one lane after _LANES_S, the others as soon as they open.

        Raises:
            GatewayError: The robot refuses, or does not answer.
        """
        self._loop = asyncio.get_running_loop()
        try:
            await self._open()
        except BaseException:
            await self._close()
            raise
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Releases, and closes the session when the release is on its way."""
        self._hold, self._ending = None, True
        self._make_command()
        self._sends.notify_all()
        try:
            await self._changes.wait_until(lambda: self._open_lanes == 0, _FAREWELL_S)
        finally:
            await self._close()

    @property
    def error(self) -> GatewayError | None:
        """Why the session has ended; None while it lasts."""
        return self._error

    @property
    def state_age_s(self) -> float:
        """Time since the newest state has arrived; infinite before the first."""
        echo_ns, at_s = self._echo
        return time.monotonic() - at_s if echo_ns else math.inf

    @property
    def lapsed(self) -> bool:
        """Whether a hold was not renewed in time: until a release, no other counts."""
        return self._lapsed

    @property
    def open_lanes(self) -> int:
        """Lanes that are connected."""
        return self._open_lanes

    def hold(
        self, vx_mps: float, vy_mps: float = 0.0, wz_rad_s: float = 0.0, *, input_device: str = ""
    ) -> None:
        """Holds, with a velocity in the robot's frame; counts for 100 ms, so it has to be repeated.

        Motion begins with a hold after a release, while the robot has no reason not to move. After a reason,
        or a stop, it takes another release and another hold.

        Args:
            vx_mps: Forward.
            vy_mps: To the left.
            wz_rad_s: Turning rate, counter-clockwise.
            input_device: What the driver steers with now; by default that of the options.

        Raises:
            ValueError: A velocity is not finite.
        """
        self._lapsed = self._lapsed or self._unrenewed(time.monotonic())
        if not all(map(math.isfinite, (vx_mps, vy_mps, wz_rad_s))):
            raise ValueError("a velocity has to be finite")
        device = input_device or self._options.input_device
        self._hold = _Hold(vx_mps, vy_mps, wz_rad_s, device, time.monotonic())

    def release(self) -> None:
        """Releases: the robot stops. Sent at once, and with every command until the next hold."""
        self._lapsed = False
        held = self._hold
        if held:
            self._let_go = True
        self._hold = None
        if held and self._loop and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._send_now)

    async def hold_for(
        self, seconds: float, vx_mps: float, vy_mps: float = 0.0, wz_rad_s: float = 0.0
    ) -> None:
        """Holds for a time, then releases.

        Raises:
            GatewayError: The session has ended.
        """
        until_s = time.monotonic() + seconds
        try:
            while time.monotonic() < until_s:
                self.check()
                self.hold(vx_mps, vy_mps, wz_rad_s)
                await asyncio.sleep(1 / COMMANDS_PER_S)
        finally:
            self.release()

    async def ready(self, within_s: float = 2.0) -> DriveState:
        """Waits until a hold would move the robot, and returns the state then.

        Raises:
            GatewayError: The session has ended, or the robot has reasons not to move.
        """
        await self._changes.wait_until(lambda: self._error is not None or self.is_ready, within_s)
        self.check()
        if self.state is None or not self.is_ready:
            raise Refused(f"the robot does not move: {self.reasons()}", "Remove the reason, then hold again")
        return self.state

    def reasons(self) -> str:
        """Returns why the robot does not move, for people."""
        if self._lapsed and self.state and self.state.phase is DrivePhase.ARMED:
            return "the last hold was not renewed in time; release, then hold again"
        state = self.state
        if state is None:
            return "it has not reported its state yet"
        return rest_reasons(state.stop, state.inhibits, state.problems) or f"it is {state.phase.value}"

    def check(self) -> None:
        """Raises the `GatewayError` that has ended the session, if it has ended."""
        if self._error:
            raise self._error

    async def states(self) -> AsyncIterator[DriveState]:
        """Yields the newest state whenever there is one that was not yielded yet.

        Raises:
            GatewayError: The session has ended.
        """
        last: DriveState | None = None
        while True:
            await self._changes.wait_until(lambda: self._error is not None or self.state is not last)  # noqa: B023
            self.check()
            if self.state and self.state is not last:
                last = self.state
                yield last

    @property
    def is_ready(self) -> bool:
        """Whether a hold would move the robot."""
        state = self.state
        if state is None or state.phase is not DrivePhase.ARMED or state.inhibits:
            return False
        # A hold begins after a release that the robot has seen since it was armed.
        return state.newest_sequence > self._armed_at and not self._command_holds and self._hold is None

    # --- commands ---

    async def _send(self) -> None:
        """Makes a command every 20 ms; after a delay of this program it does not make up for missed ones."""
        due_s = time.monotonic()
        while True:
            self._send_now()
            due_s = max(due_s + 1 / COMMANDS_PER_S, time.monotonic())
            await asyncio.sleep(due_s - time.monotonic())

    def _send_now(self) -> None:
        # Without an echo a command would be valid at no time.
        if not self._ending and self._echo[0]:
            self._make_command()
            self._sends.notify_all()

    def _make_command(self) -> None:
        now_s, hold = time.monotonic(), self._hold
        if self._let_go or self._lapsed or self._unrenewed(now_s):
            self._let_go, hold = False, None
        if hold is None and self._command_holds:
            self._released = False
        if hold and not self._command_holds and not self._released:
            # The release before it has not left yet; without it this would be the same hold, going on.
            hold = None
        self._sequence += 1
        self._command_holds = hold is not None
        echo_ns, echo_at_s = self._echo
        valid_until_ns = echo_ns + int((now_s - echo_at_s + VALID_S) * _NS_PER_S)
        self._command = command_request(
            DriveCommand(
                sequence=self._sequence,
                held=hold is not None,
                vx_mps=hold.vx_mps if hold else 0.0,
                vy_mps=hold.vy_mps if hold else 0.0,
                wz_rad_s=hold.wz_rad_s if hold else 0.0,
                echo_monotonic_ns=echo_ns,
                picture_monotonic_ns=self._picture_ns(),
                valid_until_monotonic_ns=valid_until_ns,
                input_device=hold.input_device if hold else self._options.input_device,
            )
        )

    def _unrenewed(self, now_s: float) -> bool:
        """Whether there is a hold, and it counts no more."""
        hold = self._hold
        return hold is not None and now_s - hold.at_s > HOLD_COUNTS_S

    def _picture_ns(self) -> int:
        return (self._options.picture() or 0) if self._options.picture else 0

    # --- lanes ---

    async def _open(self) -> None:
        """Opens the first lane, and waits for the others, not for long.

        One alone stands still whenever a packet is lost, and stops the robot without need.
        """
        lane = await self._first_lane()
        self._tasks += [
            asyncio.create_task(self._keep_lane(lane), name="drive lane 1"),
            *(
                asyncio.create_task(self._keep_lane(None), name=f"drive lane {number}")
                for number in range(2, LANES + 1)
            ),
            asyncio.create_task(self._send(), name="drive commands"),
        ]
        await self._changes.wait_until(lambda: self._open_lanes == LANES or self._error is not None, _LANES_S)

    async def _first_lane(self) -> tuple[LaneTransport, Lane]:
        options = self._options
        opening = open_request(self._name, options.supervision, take_over=options.take_over)
        deadline_s = time.monotonic() + self._opens_within_s
        backoff = Backoff(_FIRST_PAUSE_S, _LONGEST_PAUSE_S)
        while True:
            left_s = deadline_s - time.monotonic()
            try:
                return await self._open_lane(opening, left_s)
            except Unreachable:
                # The first packet of a connection, when lost, is sent again only after 1 s (RFC 6298 2.1): as
                # long as gRPC lets an attempt take.
                pause_s = backoff.next_s()
                if time.monotonic() + pause_s >= deadline_s:
                    raise
            await asyncio.sleep(pause_s)

    async def _open_lane(self, opening: bytes, within_s: float) -> tuple[LaneTransport, Lane]:
        transport = self._connect()
        try:
            async with asyncio.timeout(within_s):
                lane = transport.open_both_ways(DRIVE)
                await lane.write(opening)
                opened = await lane.read()
        except TimeoutError:
            await transport.close()
            raise Unreachable(f"no lane was opened within {within_s:.1f} s") from None
        except BaseException:
            await transport.close()
            raise
        if isinstance(opened, DriveOpened):
            self._session_id, self.limits = opened.session_id, opened.limits
        return transport, lane

    async def _keep_lane(self, opened: tuple[LaneTransport, Lane] | None) -> None:
        """Keeps one lane open as long as another is: the last one's end is the session's."""
        backoff = Backoff(_FIRST_PAUSE_S, _LONGEST_PAUSE_S)
        while not self._ending and self._error is None:
            try:
                joining = join_request(self._name, self._session_id)
                transport, lane = opened or await self._open_lane(joining, self._opens_within_s)
                backoff.reset()
                await self._serve_lane(transport, lane)
            except GatewayError as error:
                # Where the gateway ends a call while a command is written, gRPC's asyncio client makes up an
                # internal error. To join the session again has the gateway say why, if it is over.
                made_up = isinstance(error, GatewayFailed) and backoff.failures < _REJOINS
                if isinstance(error, Refused) or (self._open_lanes == 0 and not made_up):
                    self._lose(error)
                    return
            opened = None
            await asyncio.sleep(backoff.next_s())

    async def _serve_lane(self, transport: LaneTransport, lane: Lane) -> None:
        """Writes commands and reads states.

        Raises:
            GatewayError: The lane has ended.
        """
        on_their_way = OnTheirWay()
        self._open_lanes += 1
        self._changes.notify_all()
        writer = asyncio.create_task(self._write(lane, on_their_way), name="drive lane, commands")
        try:
            while True:
                item = await lane.read()
                if isinstance(item, DriveState):
                    on_their_way.acknowledge(item.newest_sequence)
                    self._take(item)
        finally:
            self._open_lanes -= 1
            await cancel([writer])
            lane.cancel()
            await transport.close()
            self._changes.notify_all()

    async def _write(self, lane: Lane, on_their_way: "OnTheirWay") -> None:
        """Writes the newest command whenever there is a new one; those in between are skipped."""
        seen = 0
        while True:
            await self._sends.wait_until(lambda: self._sequence > seen)  # noqa: B023  # read at once
            seen, holds, last = self._sequence, self._command_holds, self._ending
            if on_their_way.full and not last:
                continue
            on_their_way.add(seen)
            with contextlib.suppress(GatewayError):  # The reader finds out why the lane has ended.
                await lane.write(self._command)
                self._released = self._released or not holds
                if last:
                    await lane.finish()
                    return

    def _take(self, state: DriveState) -> None:
        if state.monotonic_ns <= self._echo[0]:
            return  # The other lane was faster.
        self._echo = state.monotonic_ns, time.monotonic()
        if self.state is None or self.state.phase is not DrivePhase.ARMED:
            self._armed_at = self._sequence
        self.state = state
        self._changes.notify_all()

    def _lose(self, error: GatewayError) -> None:
        if self._error is None and not self._ending:
            self._error, self._hold = error, None
        self._changes.notify_all()

    async def _close(self) -> None:
        await cancel(self._tasks)


class OnTheirWay:
    """The commands that were written on one lane and are not acknowledged yet."""

    def __init__(self) -> None:
        self._sequences: list[int] = []

    @property
    def full(self) -> bool:
        """Whether another command would only queue behind these."""
        return len(self._sequences) >= MAX_UNACKNOWLEDGED

    def add(self, sequence: int) -> None:
        """Adds a command that is written now."""
        self._sequences.append(sequence)

    def acknowledge(self, newest: int) -> None:
        """Removes what the robot has received: all commands up to the newest, on whichever lane it came."""
        self._sequences = [each for each in self._sequences if each > newest]


def rest_reasons(
    stop: StopLatch | None, inhibits: Sequence[DriveInhibit], problems: Sequence[str] = ()
) -> str:
    """Returns why the robot does not move, for people; empty where there is no reason."""
    if stop:
        return f"it is stopped {stopped_by(stop)} (stop {stop.stop_id})"
    return "; ".join(dict.fromkeys([*(SENTENCES[each] for each in inhibits), *problems]))


def stopped_by(stop: StopLatch) -> str:
    """Returns who has stopped the robot, and why, for people: by anna: a child."""
    return f"by {stop.by}: {stop.reason}" if stop.reason else f"by {stop.by}"


SENTENCES: Final = {
    DriveInhibit.UNKNOWN: "the robot gives a reason that this program does not know",
    DriveInhibit.COMMAND_LATE: "commands arrive too late",
    DriveInhibit.LOOP_LATE: "the robot's states arrive too late",
    DriveInhibit.PICTURE_MISSING: "there is no picture",
    DriveInhibit.PICTURE_STALE: "the picture is too old",
    DriveInhibit.ROBOT_STOP: "the robot's own stop is active",
    DriveInhibit.BASE_ABSENT: "nothing on the robot takes the velocity commands",
    DriveInhibit.OUTRANKED: "another source of commands has priority on the robot",
    DriveInhibit.DRIVE_LOST: "the robot's drive program does not answer",
    DriveInhibit.ACCESS_ENDED: "the driver's access has ended",
}
"""Each reason for people. Total: a test checks it."""
