"""A driver's session: a lease, commands 50 times a second, and the robot's states.

Commands go out whether the driver holds or not: the robot has to know that its driver is there.
"""

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Final, Self

from common.broadcast import Broadcast
from common.tasks import cancel
from common.version import project_version
from console.client.drive_commands import Commands, Hold
from console.client.drive_lanes import Lanes, LaneTransport, Opening, Outgoing
from console.client.drive_reasons import rest_reasons
from console.client.errors import Cancelled, GatewayError, Refused
from console.client.mapping.driving import command_request
from console.client.results import DriveLimits, DriveOpened, DrivePhase, DriveState, Supervision
from console.client.robot_clock import RobotClock

COMMANDS_PER_S: Final = 50
_FAREWELL_S: Final = 0.3
"""How long the end of a session waits for its last release to arrive."""


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


class DriveSession:
    """A lease and its lanes, while the `async with` block lasts; its end is a release.

    `hold` and `release` may be called from any thread, all else in the session's loop.

    Args:
        connect: Opens a connection for one lane.
        options: How to open the session.
        opens_within_s: Deadline of the opening.
    """

    def __init__(
        self, connect: Callable[[], LaneTransport], options: DriveOptions, opens_within_s: float
    ) -> None:
        self._options = options
        self._commands = Commands(options.input_device)
        self._changes = Broadcast()
        self._robot = _Robot(self._commands, self._changes)
        name = options.client_name or f"robotctl {project_version()}"
        opening = Opening(name, options.supervision, options.take_over, opens_within_s)
        self._lanes = Lanes(connect, opening, self._robot, self._changes)
        self._picture_ns = 0
        """Of the newest command; the farewell has it, too, whatever becomes of the caller's own code."""
        self._ending = False
        self._sender: asyncio.Task[None] | None = None
        self._loop: asyncio.AbstractEventLoop | None = None

    async def __aenter__(self) -> Self:
        """Opens the session; on a bad network with one lane, the others as soon as they open.

        Raises:
            GatewayError: The robot refuses, or does not answer.
        """
        self._loop = asyncio.get_running_loop()
        try:
            await self._lanes.open_first()
            self._sender = asyncio.create_task(self._send(), name="drive commands")
            self._sender.add_done_callback(self._sender_ended)
            await self._lanes.open_others()
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
        self._ending = True
        self._commands.end()
        try:
            self._lanes.send(self._next_command(last=True))
            await self._changes.wait_until(lambda: self._lanes.open_count == 0, _FAREWELL_S)
        finally:
            await self._close()

    @property
    def limits(self) -> DriveLimits | None:
        """What the robot accepts; None before the session is open."""
        return self._robot.limits

    @property
    def state(self) -> DriveState | None:
        """The robot's newest; None before the first."""
        return self._robot.state

    @property
    def error(self) -> GatewayError | None:
        """Why the session has ended; None while it lasts."""
        return self._robot.error

    @property
    def state_age_s(self) -> float:
        """Time since the newest state has arrived; infinite before the first."""
        return self._robot.clock.age_s(time.monotonic())

    @property
    def lapsed(self) -> bool:
        """Whether a hold was not renewed in time: until a release, no other counts."""
        return self._commands.lapsed

    @property
    def open_lanes(self) -> int:
        """Lanes that are connected."""
        return self._lanes.open_count

    @property
    def is_ready(self) -> bool:
        """Whether a hold would move the robot."""
        return self._robot.is_armed and not self._commands.holds and not self._commands.held

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
        device = input_device or self._options.input_device
        self._commands.hold(Hold(vx_mps, vy_mps, wz_rad_s, device, time.monotonic()))

    def release(self) -> None:
        """Releases: the robot stops. Sent at once, and with every command until the next hold."""
        if self._commands.release() and self._loop and not self._loop.is_closed():
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
        await self._changes.wait_until(lambda: self.error is not None or self.is_ready, within_s)
        self.check()
        if self.state is None or not self.is_ready:
            raise Refused(f"the robot does not move: {self.reasons()}", "Remove the reason, then hold again")
        return self.state

    def reasons(self) -> str:
        """Returns why the robot does not move, for people."""
        state = self.state
        if state is None:
            return "it has not reported its state yet"
        if self.lapsed and state.phase is DrivePhase.ARMED:
            return "the last hold was not renewed in time; release, then hold again"
        return rest_reasons(state.stop, state.inhibits, state.problems) or f"it is {state.phase.value}"

    def check(self) -> None:
        """Raises the `GatewayError` that has ended the session, if it has ended."""
        if self.error:
            raise self.error

    async def states(self) -> AsyncIterator[DriveState]:
        """Yields the newest state whenever there is one that was not yielded yet.

        Raises:
            GatewayError: The session has ended.
        """
        last: DriveState | None = None
        while True:
            await self._changes.wait_until(lambda: self.error is not None or self.state is not last)  # noqa: B023
            self.check()
            if self.state and self.state is not last:
                last = self.state
                yield last

    async def _send(self) -> None:
        """Sends a command every 20 ms; after a delay of this program it does not make up for missed ones."""
        due_s = time.monotonic()
        while True:
            self._send_now()
            due_s = max(due_s + 1 / COMMANDS_PER_S, time.monotonic())
            await asyncio.sleep(due_s - time.monotonic())

    def _sender_ended(self, sender: "asyncio.Task[None]") -> None:
        """Ends the session where the caller's own `picture` has ended the commands by an error."""
        if not sender.cancelled() and (error := sender.exception()):
            self._robot.lost(Cancelled(f"no commands are sent any more: {error!r}", "Mend this program"))
            self._changes.notify_all()

    def _send_now(self) -> None:
        # Without an instant of the robot a command would be valid at no time.
        if not self._ending and self._robot.clock.newest_ns:
            self._lanes.send(self._next_command())

    def _next_command(self, *, last: bool = False) -> Outgoing:
        if self._options.picture and not last:
            self._picture_ns = self._options.picture() or 0
        command = self._commands.make(time.monotonic(), self._robot.clock, self._picture_ns)
        return Outgoing(command.sequence, command.held, command_request(command), last)

    async def _close(self) -> None:
        await cancel([self._sender] if self._sender else [])
        await self._lanes.close()


class _Robot:
    """What the lanes bring: the robot's limits and its newest state, or why the session has ended.

    Args:
        commands: of the session.
        changes: notified of a newer state, and of the end.
    """

    def __init__(self, commands: Commands, changes: Broadcast) -> None:
        self._commands = commands
        self._changes = changes
        self._armed_at = 0
        """The newest command when the robot said that it was armed."""
        self.clock = RobotClock()
        self.limits: DriveLimits | None = None
        self.state: DriveState | None = None
        self.error: GatewayError | None = None

    @property
    def is_armed(self) -> bool:
        """Whether nothing keeps the robot from moving, and it has seen a command since it was armed."""
        state = self.state
        if state is None or state.phase is not DrivePhase.ARMED or state.inhibits:
            return False
        # A hold begins after a release that the robot has seen since it was armed.
        return state.newest_sequence > self._armed_at

    def opened(self, opened: DriveOpened) -> None:
        """Takes the robot's limits."""
        self.limits = opened.limits

    def received(self, state: DriveState) -> None:
        """Takes a state, unless another lane was faster."""
        if state.monotonic_ns <= self.clock.newest_ns:
            return
        self.clock.note(state.monotonic_ns, time.monotonic())
        if self.state is None or self.state.phase is not DrivePhase.ARMED:
            self._armed_at = self._commands.sequence
        self.state = state
        self._changes.notify_all()

    def left(self, command: Outgoing) -> None:
        """Takes note of a command that has left on a lane."""
        self._commands.left(command.sequence, held=command.held)

    def lost(self, error: GatewayError) -> None:
        """Ends the hold: the session has ended."""
        self.error = error
        self._commands.end()
