"""The practice robot as the monitor's worker sees a robot: one client, in the worker's own event loop."""

import asyncio
import time
from collections.abc import AsyncGenerator, AsyncIterator, Callable
from dataclasses import replace
from typing import Final, Never, Self, TypeVar

from common.tasks import cancel
from console.client import (
    Clock,
    DesiredPreview,
    DriveOptions,
    DriveSession,
    Offset,
    Outage,
    PreviewChange,
    Refused,
    Unreachable,
    Unsupported,
    results,
)
from drive.motion.machine import Enable, EndLease, Event, GrantLease, Reset, Stop
from drive.motion.values import Command, LeaseEnd
from practice import wire
from practice.lane import Lane, LaneTransport, Way
from practice.network import Network
from practice.no_recordings import NoRecordings
from practice.robot import PracticeRobot

ResultT = TypeVar("ResultT")

_CYCLE_S: Final = 0.02
_REPORT_EVERY_S: Final = 0.05
"""As the drive program (drive/processes/worker.py)."""
_ANSWER_WITHIN_S: Final = 1.5


class PracticeSession(NoRecordings):
    """Serves one window while its `async with` block lasts.

    Args:
        robot: is driven.
        network: returns what is between the window and the robot now.
    """

    def __init__(self, robot: PracticeRobot, network: Callable[[], Network]) -> None:
        self.clock = Clock()
        """The estimate of the robot's clock."""
        self._robot = robot
        self._up, self._down = Way(network), Way(network)
        self._lanes: list[Lane] = []
        self._sessions = 0
        self._reported_s = 0.0
        self._cycles: asyncio.Task[Never] | None = None

    async def __aenter__(self) -> Self:
        self._cycles = asyncio.create_task(self._run(), name="practice-robot")
        return self

    async def __aexit__(self, *_: object) -> None:
        if self._cycles:
            await cancel([self._cycles])

    # --- the client ---

    @property
    def client(self) -> Self:
        """This robot's only client."""
        return self

    async def refresh(self) -> bool:
        """Returns False: there are no credentials."""
        return False

    async def watch_status(
        self, min_interval_s: float = 0.1, *, include_detections: bool = False
    ) -> AsyncGenerator[results.WatchedStatus | Outage]:
        """Yields the status again and again.

        Raises:
            Unreachable: nothing passes the network.
        """
        while True:
            watched = await self._call(lambda now_ns: wire.watched(self._robot, now_ns))
            yield watched if include_detections else replace(watched, detections=None)
            await asyncio.sleep(min_interval_s)

    async def ping(self) -> Offset:
        """Improves `clock`, and returns its offset."""
        sent_s = time.monotonic()
        robot = await self._call(wire.robot_time)
        received_s = time.monotonic()
        self.clock.note(sent_s, robot, received_s)
        offset = self.clock.offset(received_s)
        assert offset is not None, "a reading was noted"  # noqa: S101  # of this very call
        return offset

    async def overlay(self) -> results.OverlaySnapshot:
        """Raises Unsupported: the status is watched."""
        raise Unsupported("the practice robot's status is watched")

    async def events(
        self, after: results.EventPosition | None = None
    ) -> AsyncIterator[results.Event | results.EventGap | results.CaughtUp | Outage]:
        """Yields that there are none, and never ends."""
        yield results.CaughtUp(position=after or results.EventPosition(run_id=wire.NAME, sequence=0))
        await asyncio.Event().wait()

    async def set_preview(self, desired: DesiredPreview, *, settle_within_s: float = 0.0) -> PreviewChange:
        """Turns the picture on or off."""

        def change(now_ns: int) -> PreviewChange:
            self._robot.preview_on = desired.enabled
            preview = wire.watched(self._robot, now_ns).status.preview
            return PreviewChange(accepted=True, message=f"preview is {preview.state.value}", preview=preview)

        del settle_within_s
        return await self._call(change)

    async def request_key_frame(self, newest_pts: int | None = None) -> results.KeyFrameAnswer:
        """Returns that none is needed: each picture is whole."""
        del newest_pts
        return results.KeyFrameAnswer(forced=False)

    async def report_picture(self, report: results.PictureReport) -> None:
        """Takes a report, which nothing here needs."""

    def drive(self, options: DriveOptions | None = None) -> DriveSession:
        """Returns the client library's own session, over lanes without a connection."""
        return DriveSession(
            lambda: LaneTransport(Lane(self, self._up)), options or DriveOptions(), _ANSWER_WITHIN_S
        )

    async def stop_robot(self, reason: str = "") -> results.RobotStopped:
        """Stops the robot.

        Raises:
            Unreachable: nothing passes the network.
        """

        def stop(now_ns: int) -> results.RobotStopped:
            self._feed(Stop(wire.DRIVER, reason), now_ns)
            latch = wire.stop(self._robot.state, now_ns)
            assert latch is not None, "it was stopped"  # noqa: S101  # a stop latches in every phase
            return results.RobotStopped(message="the practice robot is stopped", stop=latch)

        return await self._call(stop)

    async def reset_stop(self, stop_id: int) -> results.StopReset:
        """Resets a stop.

        Raises:
            Refused: it is not the present one, or the driver holds.
            Unreachable: nothing passes the network.
        """

        def reset(now_ns: int) -> results.StopReset:
            self._feed(Reset(stop_id), now_ns)
            latch = self._robot.state.latch
            if latch:
                why = "release first" if latch.stop_id == stop_id else f"the present stop is {latch.stop_id}"
                raise Refused(f"stop {stop_id} is not reset: {why}")
            message = "the stop is reset; release, and hold again"
            return results.StopReset(message=message, phase=wire.phase(self._robot.state))

        return await self._call(reset)

    async def set_driving_enabled(self, enabled: bool) -> results.TeleopAnswer:
        """Enables driving, or disables it."""

        def change(now_ns: int) -> results.TeleopAnswer:
            self._feed(Enable(enabled), now_ns)
            teleop = wire.watched(self._robot, now_ns).status.teleop
            return results.TeleopAnswer(
                accepted=True, message=f"driving is {teleop.state.value}", teleop=teleop
            )

        return await self._call(change)

    async def _call(self, act: Callable[[int], ResultT]) -> ResultT:
        """Returns what `act` answers on the robot, given its clock; by way of the network, both ways.

        Raises:
            Unreachable: no answer has come in time.
        """
        answered: asyncio.Future[ResultT] = asyncio.get_running_loop().create_future()

        def answer() -> None:
            if answered.done():
                return  # As a gateway: what no one waits for any more is not done.
            outcome: ResultT | Refused
            try:
                outcome = act(time.monotonic_ns())
            except Refused as refusal:
                outcome = refusal
            self._down.send(lambda: take(outcome))

        def take(outcome: ResultT | Refused) -> None:
            if answered.done():
                return
            if isinstance(outcome, Refused):
                answered.set_exception(outcome)
            else:
                answered.set_result(outcome)

        self._up.send(answer)
        try:
            async with asyncio.timeout(_ANSWER_WITHIN_S):
                return await answered
        except TimeoutError:
            raise Unreachable("nothing passes the practice network", "Choose another network above") from None

    # --- the robot's end ---

    def take(self, lane: Lane, request: bytes) -> None:
        """Takes a request of a lane."""
        asked = wire.request(request, lane.session_id or f"practice-{self._sessions + 1}")
        if isinstance(asked, Command):
            self._feed(asked, time.monotonic_ns())
        else:
            self._open(lane, asked)

    def leave(self, lane: Lane, *, in_order: bool) -> None:
        """Takes the end of a lane; the last one's is that of the session."""
        if lane not in self._lanes:
            return
        self._lanes.remove(lane)
        self._down.send(lambda: lane.deliver(Unreachable("the lane has ended")))
        lease = self._robot.state.lease
        if lease and not self._lanes:
            why = LeaseEnd.CLOSED if in_order else LeaseEnd.LOST
            self._feed(EndLease(lease.session_id, why), time.monotonic_ns())

    def _open(self, lane: Lane, opening: wire.Opening) -> None:
        if opening.lease and self._robot.state.enabled:
            self._sessions += 1
            self._feed(GrantLease(opening.lease), time.monotonic_ns())
        if self._robot.state.lease is None:
            why = Refused("there is no session, or driving is disabled", "Press T again, or enable driving")
            self._down.send(lambda: lane.deliver(why))
            return
        lane.session_id = self._robot.state.lease.session_id
        self._lanes.append(lane)
        opened = wire.opened(lane.session_id, self._robot.rules)
        self._down.send(lambda: lane.deliver(opened))

    def _feed(self, event: Event, now_ns: int) -> None:
        before = self._robot.state
        self._robot.feed(event, now_ns)
        after = self._robot.state
        if (before.phase, before.inhibits, before.latch) != (after.phase, after.inhibits, after.latch):
            self._report(now_ns)

    def _report(self, now_ns: int) -> None:
        """Sends the state on all lanes; to those of a session that has ended, its end."""
        self._reported_s = now_ns / 1e9
        item: object = wire.drive_state(self._robot, now_ns)
        if self._robot.state.lease is None:
            item = Refused("the robot has lost its driver", "Press T to drive again")
        for lane in self._lanes:
            self._down.send(lambda lane=lane: lane.deliver(item))  # type: ignore[misc]  # mypy infers no lambda
        if self._robot.state.lease is None:
            self._lanes.clear()

    async def _run(self) -> Never:
        while True:
            now_ns = time.monotonic_ns()
            self._robot.advance(now_ns)
            self._up.go_on()
            self._down.go_on()
            if self._lanes and now_ns / 1e9 - self._reported_s >= _REPORT_EVERY_S:
                self._report(now_ns)
            await asyncio.sleep(_CYCLE_S)
