"""Stops and their resets, confirmed by the drive program."""

import asyncio
import time
from dataclasses import dataclass
from typing import Final, Self

from common.backoff import Backoff
from common.errors import DriveUnreachableError, PreconditionError
from common.reasons import Reason
from common.token_bucket import TokenBucket
from gateway.links.drive.commands import DriveCommands
from gateway.links.drive.state import DriveLink
from gateway.status.teleop import DriveActual, DrivePhase, DriveView, StopLatch

CONFIRMED_WITHIN_S: Final = 1.0
"""How long the drive program may take to confirm a stop, a reset or a switch."""
HOW_TO_REACH: Final = (
    "start or restart robot-drive on the robot; the gateway connects by itself. Without the gateway's "
    "commands it publishes zeros, or nothing"
)
_KEPT: Final = f"It gets the stop first of all when it is connected again: {HOW_TO_REACH}"
_AT_ONCE: Final = 10.0
_PER_S: Final = 10.0
"""So many stops of one caller at once, and so many more a second, get a number each. Those beyond get the
stop in force: no person is so fast, and a flood costs the drive program no more."""
_RETRY_FIRST_S: Final = 0.005
_RETRY_LONGEST_S: Final = 0.05
"""While the connection to the drive program takes no more."""
_NS_PER_S: Final = 1_000_000_000
COPIES_NS: Final = 10 * _NS_PER_S
"""A copy of a request is recognised for so long; no client waits longer for an answer."""
MOST_COPIES: Final = 64
"""Requests that are remembered; a copy of an older one stops the robot, as one without a request ID does."""


def in_words(stop: StopLatch) -> str:
    """Returns what a stop means for a driver, and how it ends, for people."""
    return f"the robot is stopped by {stop.by} until you type: robotctl reset-stop {stop.stop_id}"


class Copies:
    """The stops that were confirmed lately, by the requests that made them."""

    def __init__(self) -> None:
        self._stops: dict[tuple[str, str], tuple[int, StopLatch]] = {}

    def first(self, by: str, request_id: str, now_ns: int) -> StopLatch | None:
        """Returns the stop that an earlier copy of a request has made; None for a request of its own."""
        confirmed_ns, stop = self._stops.get((by, request_id), (now_ns - COPIES_NS, None))
        return stop if now_ns - confirmed_ns < COPIES_NS else None

    def confirmed(self, by: str, request_id: str, stop: StopLatch, now_ns: int) -> None:
        """Keeps the stop that a request has made, for `COPIES_NS`; of MOST_COPIES the oldest goes."""
        if not request_id:
            return
        kept = [item for item in self._stops.items() if now_ns - item[1][0] < COPIES_NS]
        self._stops = dict(kept[-MOST_COPIES + 1 :])
        # By the first copy: a request ID that is used for ever keeps no stop out for longer.
        self._stops.setdefault((by, request_id), (now_ns, stop))


class Pace:
    """Which stops of a caller are beyond what the drive program is sent."""

    def __init__(self) -> None:
        self._buckets: dict[str, TokenBucket] = {}

    def beyond(self, by: str, now_s: float) -> bool:
        """Counts a stop of a caller, and returns whether it is one too many."""
        # Those that are full again say nothing.
        full_after_s = _AT_ONCE / _PER_S
        self._buckets = {
            name: bucket for name, bucket in self._buckets.items() if now_s - bucket.updated_s < full_after_s
        }
        bucket = self._buckets.setdefault(by, TokenBucket(_AT_ONCE, now_s))
        return not bucket.take(now_s, capacity=_AT_ONCE, refill_per_s=_PER_S)

    def forget(self) -> None:
        """Begins anew."""
        self._buckets.clear()


@dataclass(frozen=True, slots=True)
class _Sent:
    """When a stop was sent, and what the drive program had reported until then.

    Attributes:
        instance_id: its process; empty before the first report.
        stops: that this process had taken.
    """

    at_ns: int
    instance_id: str
    stops: int

    @classmethod
    def now(cls, view: DriveView) -> Self:
        """Returns it for a stop that is about to be sent."""
        actual = view.actual
        if actual is None:
            return cls(time.monotonic_ns(), "", 0)
        return cls(time.monotonic_ns(), actual.instance_id, actual.counters.stops)

    def taken(self, view: DriveView) -> bool:
        """Returns whether the drive program has taken a stop since; no reset on its way has seen that one."""
        actual = _report_since(view, self.at_ns)
        if actual is None:
            return False
        return actual.counters.stops > (self.stops if actual.instance_id == self.instance_id else 0)


def _report_since(view: DriveView, since_ns: int) -> DriveActual | None:
    """Returns what a drive program that is reachable has reported since an instant; None without a report."""
    actual = view.actual
    return actual if view.reachable and actual and actual.monotonic_ns >= since_ns else None


class Stops:
    """Stops the robot, for callers of every role, and resets that.

    A stop that the drive program does not confirm is kept, the newest one alone, and is the first message of
    the next connection, however late that comes, because no reset has undone it. Its caller knows that.

    Args:
        link: to the drive program.
        commands: what it is sent beside the desired state.
    """

    def __init__(self, link: DriveLink, commands: DriveCommands) -> None:
        self._link = link
        self._commands = commands
        self._pace = Pace()
        """Of callers while the stop in force holds; anew after a reset."""
        self._sent: dict[str, _Sent] = {}
        """Each caller's stop that was sent and is awaited."""
        self._kept: _Sent | None = None
        """The newest stop, until it is confirmed, awaited or not."""
        self._copies = Copies()

    async def stop(self, by: str, reason: str, request_id: str = "") -> StopLatch:
        """Stops the robot, and returns the stop when the drive program has confirmed it.

        Each request gets a stop of its own, which only a reset that has seen it undoes: two people may share
        a credential. A copy of a request whose stop was confirmed returns that one, reset or not, and stops
        nothing anew.

        Args:
            by: who, for people.
            reason: why, for people.
            request_id: the same for all copies of one request; empty for a request without copies.

        Raises:
            DriveUnreachableError: it has not.
        """
        view, now_ns = self._link.view, time.monotonic_ns()
        if first := self._copies.first(by, request_id, now_ns):
            return first
        if view.stop and view.reachable and self._pace.beyond(by, now_ns / _NS_PER_S):
            stop = view.stop
        else:
            stop = await self._stop_anew(by, reason)
        self._copies.confirmed(by, request_id, stop, now_ns)
        return stop

    async def _stop_anew(self, by: str, reason: str) -> StopLatch:
        """Sends a stop, unless one of the same caller is on its way, and waits until it is confirmed.

        The number of one that is on its way is not known to any caller yet.
        """
        if sent := self._sent.get(by):
            await self._wait_for_confirmation(sent)
        else:
            sent = self._kept = _Sent.now(self._link.view)
            await self._send(by, reason)
            self._sent[by] = sent
            try:
                await self._wait_for_confirmation(sent)
            finally:
                self._sent.pop(by, None)
        stop = self._link.view.stop
        if stop is None:
            raise DriveUnreachableError(f"the stop is already reset; stop again, or {HOW_TO_REACH}")
        return stop

    async def _send(self, by: str, reason: str) -> None:
        """Sends a stop; tries again while the connection is full, as long as a confirmation may take."""
        retry, loop = Backoff(_RETRY_FIRST_S, _RETRY_LONGEST_S), asyncio.get_running_loop()
        deadline_s = loop.time() + CONFIRMED_WITHIN_S
        while not self._commands.stop(by, reason):
            if not self._link.view.reachable or loop.time() > deadline_s:
                raise DriveUnreachableError(
                    f"the robot's drive program can't be reached, and has not confirmed the stop. {_KEPT}"
                )
            await asyncio.sleep(retry.next_s())

    async def _wait_for_confirmation(self, sent: _Sent) -> None:
        def confirmed() -> bool:
            view = self._link.view
            return sent.taken(view) and view.phase is DrivePhase.STOPPED

        if not await self._link.changes.wait_until(confirmed, CONFIRMED_WITHIN_S):
            raise DriveUnreachableError(f"the robot's drive program has not confirmed the stop. {_KEPT}")
        self.follow()

    def follow(self) -> None:
        """Keeps the newest stop until the drive program has taken it; to be called on each report."""
        if self._kept and self._kept.taken(self._link.view):
            self._kept = None
            self._commands.stop_confirmed()

    def in_force(self, stop: StopLatch) -> bool:
        """Returns whether a stop was not reset, as far as the drive program has reported."""
        present = self._link.view.stop
        return present is not None and present.stop_id == stop.stop_id

    async def reset(self, stop_id: int) -> str:
        """Resets a stop; returns what happened, for people.

        Raises:
            PreconditionError: it is not the present one, or the robot might move by its reset.
            DriveUnreachableError: the drive program does not answer.
        """
        stop, now_ns = self._link.view.stop, time.monotonic_ns()
        if stop is None or stop.stop_id != stop_id:
            present = (
                f"the present stop is {stop.stop_id}, by {stop.by}" if stop else "the robot is not stopped"
            )
            raise PreconditionError(f"stop {stop_id} can't be reset: {present}", Reason.STOP_NOT_RESET)

        obstructed = set[int]()
        """When the stop was reported with an obstacle."""

        def answered() -> bool:
            # A report of this stop may be from before the reset has arrived; the second one with an obstacle
            # is not.
            actual = _report_since(self._link.view, now_ns)
            if actual is None:
                return False
            if actual.stop is None or actual.stop.stop_id != stop_id:
                return True
            if actual.reset_obstacle:
                obstructed.add(actual.monotonic_ns)
            return len(obstructed) > 1

        self._pace.forget()
        sent = self._commands.reset(stop_id)
        if sent:
            await self._link.changes.wait_until(answered, CONFIRMED_WITHIN_S)
        view = self._link.view
        if not sent or _report_since(view, now_ns) is None:
            raise DriveUnreachableError(f"the robot's drive program does not answer: {HOW_TO_REACH}")
        newer = view.stop
        if newer and newer.stop_id == stop_id:
            obstacle = view.actual.reset_obstacle if view.actual else ""
            raise PreconditionError(
                f"stop {stop_id} is not reset: {obstacle or 'try again'}", Reason.STOP_NOT_RESET
            )
        if newer:
            return f"stop {stop_id} is reset; the robot was stopped again by {newer.by}"
        return "the stop is reset; the driver has to release and to hold again"
