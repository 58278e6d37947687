"""Driving from a window: the session, and what a driver or a viewer asks for besides it.

The session lives in the worker's loop, so that a window that hangs sends nothing: what it held counts for
100 ms (`console.client.drive_commands.HOLD_COUNTS_S`), and the session itself goes on to send releases.
"""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final, NoReturn, Protocol

from common.tasks import first_to_end
from console.client import (
    DriveOptions,
    DriveSession,
    DriveState,
    GatewayError,
    Supervision,
)
from console.client.results import DriveLimits, RobotStopped, StopReset, TeleopAnswer
from console.monitor.calls import Calls
from console.monitor.notes import Notes
from console.presentation.preview_switch import Note
from console.presentation.severity_style import SeverityStyle
from console.steering import Speeds, Steering

_STOPS_END_WITHIN_S: Final = 0.5
"""How long a window that is closed waits for the confirmation of a stop."""


class DriveClient(Protocol):
    """The calls of `console.client.AsyncGatewayClient` that a driver makes."""

    def drive(self, options: DriveOptions | None = ...) -> DriveSession:
        """Returns a session."""

    async def stop_robot(self, reason: str = ...) -> RobotStopped:
        """Stops the robot."""

    async def reset_stop(self, stop_id: int) -> StopReset:
        """Resets a stop."""

    async def set_driving_enabled(self, enabled: bool) -> TeleopAnswer:
        """Enables driving, or disables it."""


class DriveRobot(Protocol):
    """The client in use; another one after each change of the credentials."""

    @property
    def client(self) -> DriveClient:
        """The client with the credentials in use."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriverView:
    """The window's own driving at one moment.

    Args:
        opening: whether a session is being opened.
        supervision: how the driver sees the robot, while a session is open; else None.
        limits: what the robot accepts; None without a session.
        state: the robot's newest; None without a session, and before the first.
        state_age_s: time since it has arrived.
        ready: whether a hold would move the robot.
        lapsed: whether the window was too slow to renew what it holds: until a release, no other hold counts.
        stopping: whether a stop waits for the robot's confirmation.
    """

    opening: bool = False
    supervision: Supervision | None = None
    limits: DriveLimits | None = None
    state: DriveState | None = None
    state_age_s: float = 0.0
    ready: bool = False
    lapsed: bool = False
    stopping: bool = False

    @property
    def open(self) -> bool:
        """Whether this window has the lease."""
        return self.supervision is not None


class Driver:
    """Opens a session, passes on what the hands hold, stops and resets. Thread-safe; nothing here waits.

    Args:
        call_soon: calls a function in the loop that runs `run`.
        on_change: called in that loop after each change of what `view` and `take_notes` return, but for the
            robot's states; must only hand over.
        picture: returns when the picture on the screen was captured (`DriveOptions.picture`).
    """

    _robot: DriveRobot

    def __init__(
        self,
        call_soon: Callable[[Callable[[], object]], None],
        on_change: Callable[[], None],
        picture: Callable[[], int | None],
    ) -> None:
        self._call_soon = call_soon
        self._on_change = on_change
        self._picture = picture
        self._requested = asyncio.Event()
        self._ending = asyncio.Event()
        self._options: DriveOptions | None = None
        """Of the session that is open, or being opened."""
        self._session: DriveSession | None = None
        self._notes = Notes(on_change)
        self._calls, self._stops = Calls(on_change), Calls(on_change)

    # --- any thread ---

    def view(self) -> DriverView:
        """Returns the present view."""
        session, options, stopping = self._session, self._options, bool(self._stops)
        if session is None or options is None:
            return DriverView(opening=options is not None, stopping=stopping)
        return DriverView(
            supervision=options.supervision,
            limits=session.limits,
            state=session.state,
            state_age_s=session.state_age_s,
            ready=session.is_ready,
            lapsed=session.lapsed,
            stopping=stopping,
        )

    def take_notes(self) -> list[Note]:
        """Returns the answers that were not taken yet."""
        return self._notes.take()

    def begin(self, supervision: Supervision = Supervision.PICTURE, *, take_over: bool = False) -> None:
        """Opens a session; no-op while there is one."""
        options = DriveOptions(
            take_over=take_over,
            supervision=supervision,
            picture=self._picture if supervision is Supervision.PICTURE else None,
            input_device="monitor",
        )
        self._call_soon(partial(self._begin, options))

    def end(self) -> None:
        """Releases, and ends the session."""
        self.release()
        self._call_soon(self._ending.set)

    def hold(self, steering: Steering, input_device: str) -> None:
        """Holds, for 100 ms; no-op without a session."""
        session, options = self._session, self._options
        if session and options and session.limits:
            speeds = Speeds(*session.limits.permitted(options.supervision))
            session.hold(*speeds.velocity(steering), input_device=input_device)

    def release(self) -> None:
        """Releases: the robot stops. At once."""
        if session := self._session:
            session.release()

    def stop(self, reason: str) -> None:
        """Stops the robot until a reset, no matter who drives it. Needs no session."""
        self.release()
        self._call_soon(partial(self._stops.start, partial(self._stop, reason)))

    def reset(self, stop_id: int) -> None:
        """Resets this stop; a newer one stays."""
        self._call_soon(partial(self._calls.start, partial(self._reset, stop_id)))

    def set_enabled(self, enabled: bool) -> None:
        """Enables driving, or disables it, for all."""
        self._call_soon(partial(self._calls.start, partial(self._set_enabled, enabled)))

    # --- the loop ---

    async def run(self, robot: DriveRobot) -> NoReturn:
        """Serves until cancelled: then the session ends with a release, and pending stops are confirmed."""
        self._robot = robot
        try:
            while True:
                await self._requested.wait()
                self._requested.clear()
                if self._options:
                    await self._drive(self._options)
        finally:
            await self._stops.wait(_STOPS_END_WITHIN_S)
            self._stops.cancel()
            self._calls.cancel()

    def _begin(self, options: DriveOptions) -> None:
        if self._options is None:
            self._options = options
            self._ending.clear()
            self._requested.set()
            self._on_change()

    async def _drive(self, options: DriveOptions) -> None:
        try:
            async with self._robot.client.drive(options) as session:
                self._session = session
                self._on_change()
                await self._until_the_end(session)
        except GatewayError as error:
            self._notes.add(f"Not driving: {error}", SeverityStyle.BAD)
        finally:
            self._session = self._options = None
            self._on_change()

    async def _until_the_end(self, session: DriveSession) -> None:
        """Waits until `end` is called.

        Raises:
            GatewayError: The session has ended by itself.
        """
        try:
            await first_to_end(_until_lost(session), self._ending.wait())
        except GatewayError:
            if not self._ending.is_set():
                raise

    async def _stop(self, reason: str) -> None:
        try:
            stopped = await self._robot.client.stop_robot(reason)
        except GatewayError as error:
            self._notes.add(f"The robot has NOT confirmed the stop: {error}", SeverityStyle.BAD)
        else:
            self._notes.add(f"Stopped: {stopped.message}", SeverityStyle.WARNING)

    async def _reset(self, stop_id: int) -> None:
        try:
            self._notes.add((await self._robot.client.reset_stop(stop_id)).message, SeverityStyle.QUIET)
        except GatewayError as error:
            self._notes.add(f"Not reset: {error}", SeverityStyle.BAD)

    async def _set_enabled(self, enabled: bool) -> None:
        try:
            answer = await self._robot.client.set_driving_enabled(enabled)
        except GatewayError as error:
            wanted = "enabled" if enabled else "disabled"
            self._notes.add(f"Driving is not {wanted}: {error}", SeverityStyle.BAD)
        else:
            self._notes.add(answer.message, SeverityStyle.QUIET if answer.accepted else SeverityStyle.BAD)


async def _until_lost(session: DriveSession) -> None:
    async for _ in session.states():
        pass
