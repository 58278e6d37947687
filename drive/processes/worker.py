"""The process that moves the robot: one thread that reads the gateway, steps the machine and publishes.

Its parent, the guard, ends it when it is silent. It never waits for anything but time and its sockets.
"""

import gc
import logging
import secrets
import socket
import time
from dataclasses import replace
from typing import Final, Protocol

from common.garbage import freeze_objects
from common.suspend import SuspendWatch
from drive.endpoint import wire
from drive.endpoint.endpoint import Endpoint, Peer, Received
from drive.motion.episode import Episode, followed
from drive.motion.machine import EndLease, Event, Observe, Rules, State, Stop, Tick, step
from drive.motion.phases import RESTING, Phase
from drive.motion.values import MS, ZERO, LeaseEnd, Surroundings, Velocity
from drive.processes.reach import ReachHeard
from omniseer.drive.v1 import drive_pb2 as pb

_log = logging.getLogger(__name__)

_CYCLE_NS: Final = 20 * MS
"""50 velocities a second while the robot moves."""
_REST_CYCLE_NS: Final = 100 * MS
"""Without a driver; a packet of the gateway ends the wait at once."""
_ZERO_EVERY_NS: Final = 50 * MS
"""20 zeros a second keep sources of lower priority away: twist_mux forgets a source after 500 ms."""
_STRESS_NS: Final = 500 * MS
"""Zeros that follow anything else are repeated every cycle for so long: a lost one is made up for at once."""
_REPORT_EVERY_NS: Final = 50 * MS
_REST_REPORT_EVERY_NS: Final = 500 * MS
_LATE_NS: Final = 5 * MS
_STALE_NS: Final = 40 * MS
"""An older decision is made again before it is published, as is one whose command has expired meanwhile: the
process may have been frozen in between."""
_PICTURE_NS: Final = 1_200 * MS
"""The gateway's word about the preview is worth nothing afterwards."""
_FAREWELL_ZEROS: Final = 5
_CONFIRMED: Final = frozenset({"desired", "stop", "reset"})
"""Messages that the gateway waits for the effect of, also where they change nothing."""
_GUARD_NS: Final = 700 * MS
"""For a guard that has to be scheduled among everything else."""
_COLLECT_EVERY_NS: Final = 60_000 * MS
_NOT_GUARDED: Final = "the guard of robot-drive does not reach the base yet, and could not stop it"


class BasePort(Protocol):
    """What the worker needs of the base (drive.ros.base)."""

    def publish(self, velocity: Velocity, now_ns: int) -> None:
        """Publishes a velocity."""

    def lock(self, now_ns: int, *, active: bool) -> bool:
        """Locks or unlocks the multiplexer, where it can be; returns whether that is decided."""

    def lock_left(self) -> bool:
        """Returns whether the lock was published here, and is not known to be released since."""

    def observed(self, now_ns: int) -> Surroundings:
        """Returns what the graph says now."""

    def matched(self) -> int:
        """Returns how many subscriptions take the velocities."""

    def problems(self) -> list[str]:
        """Returns what does not work, for people."""

    def wait_until_acknowledged(self) -> None:
        """Waits, for a moment, until the last velocity has arrived."""


class Worker:
    """Runs the machine against the base and the gateway.

    Args:
        base: publishes, and observes the graph.
        endpoint: where the gateway connects.
        heartbeats: each carries an ActualState; the guard reads them.
        rules: of the machine.
        state: at the start.
        episode: of an earlier process, which no gateway has recorded.
        worker_kills: how many before this one the guard has ended.
    """

    def __init__(
        self,
        base: BasePort,
        endpoint: Endpoint,
        heartbeats: socket.socket,
        rules: Rules,
        state: State,
        *,
        episode: Episode | None = None,
        worker_kills: int = 0,
    ) -> None:
        self._base = base
        self._endpoint = endpoint
        self._heartbeats = heartbeats
        self._reach = ReachHeard(heartbeats)
        self._guard_problem = ""
        self._matched = 0
        """How many subscriptions took the velocities when last observed."""
        self._rules = rules
        self._state = state
        self._revision = 0
        self._picture = pb.Picture()
        self._picture_ns = 0
        self._counters = pb.Counters(worker_kills=worker_kills)
        self._episode = episode
        self._suspends = SuspendWatch()
        self._cycled_ns = 0
        self._published_ns = 0
        self._reported_ns = 0
        self._guard_read_ns = time.monotonic_ns()
        self._stress_until_ns = 0
        self._collected_ns = 0
        self._unlocks = 0
        self.stopping = False
        self.orphaned = False
        """Whether the guard has gone, or is frozen."""

    def run(self) -> None:
        """Runs until `stopping` is set; the last velocity is zero, whatever ends it."""
        freeze_objects()
        # A collection takes milliseconds: while the robot may move none is made.
        gc.disable()
        try:
            while not self.stopping:
                self._run_once()
        finally:
            self._say_farewell()

    def _run_once(self) -> None:
        """Waits for a message, the next cycle, or the end of the command's validity, and acts on it."""
        expires_ns, expected_ns = self._state.expires_ns, self._due_ns
        until_ns = expected_ns if expires_ns is None else min(expected_ns, expires_ns)
        arrived = self._endpoint.wait((until_ns - time.monotonic_ns()) / 1e9)
        if self._suspends.resumed():
            # First: what has arrived may be as old as the suspend is long.
            _log.warning("the computer was suspended: a driver counts as lost")
            self._lose_driver(time.monotonic_ns())
        for received in arrived:
            self._take(received, time.monotonic_ns())
        now_ns, due_ns = time.monotonic_ns(), self._due_ns
        if now_ns >= due_ns:
            self._counters.late_cycles += self._cycled_ns > 0 and now_ns - expected_ns > _LATE_NS
            # Cycles that were missed are not caught up.
            self._cycled_ns = max(due_ns, now_ns - _LATE_NS)
            self._cycle(now_ns)
        elif self._state.expires_ns is not None and now_ns >= self._state.expires_ns:
            self._feed(Tick(), now_ns)

    @property
    def state(self) -> State:
        """Of the machine."""
        return self._state

    @property
    def unrecorded(self) -> Episode | None:
        """A time of motion that has ended, and that no gateway has recorded."""
        return self._episode if self._episode and self._episode.unrecorded else None

    @property
    def lock_left(self) -> bool:
        """Whether the lock was published, and is not known to be released since."""
        return self._base.lock_left()

    @property
    def _due_ns(self) -> int:
        """When the next cycle is due: at once after the end of a rest."""
        return self._cycled_ns + (_REST_CYCLE_NS if self._state.phase in RESTING else _CYCLE_NS)

    def _take(self, received: Received, now_ns: int) -> None:
        if received is Peer.LEFT:
            self._gateway_left(now_ns)
        elif received is Peer.JOINED:
            self._report(now_ns)
        elif received.WhichOneof("message") == "picture":
            self._picture, self._picture_ns = received.picture, now_ns
        elif received.WhichOneof("message") == "recorded":
            self._take_record(received.recorded)
        elif event := wire.event_of(received):
            self._feed(event, now_ns)
            if received.WhichOneof("message") == "desired":
                self._revision = received.desired.revision
            if received.WhichOneof("message") in _CONFIRMED:
                self._report(now_ns)

    def _take_record(self, recorded: pb.Recorded) -> None:
        episode = self._episode
        if episode and (episode.episode_id, episode.started_ns) == (recorded.episode_id, recorded.started_ns):
            self._episode = replace(episode, recorded=True)

    def _gateway_left(self, now_ns: int) -> None:
        _log.warning("the gateway has gone")
        self._picture = pb.Picture()
        self._lose_driver(now_ns)

    def _lose_driver(self, now_ns: int) -> None:
        if lease := self._state.lease:
            self._feed(EndLease(lease.session_id, LeaseEnd.LOST), now_ns)

    def _cycle(self, now_ns: int) -> None:
        self._feed(Observe(self._surroundings(now_ns)), now_ns)
        # First: the guard must know that there may be motion before there is any.
        self._beat(now_ns)
        self._publish(now_ns)
        self._publish_lock(now_ns)
        every_ns = _REST_REPORT_EVERY_NS if self._state.phase in RESTING else _REPORT_EVERY_NS
        if now_ns - self._reported_ns >= every_ns:
            self._report(now_ns)
        if self._state.phase in RESTING and now_ns - self._collected_ns >= _COLLECT_EVERY_NS:
            self._collected_ns = now_ns
            gc.collect()

    def _surroundings(self, now_ns: int) -> Surroundings:
        observed = self._base.observed(now_ns)
        self._matched = self._base.matched()
        guarded = self._reach.reaches(self._matched if observed.base_present else 0, now_ns)
        self._guard_problem = _NOT_GUARDED if observed.base_present and not guarded else ""
        age_ns = now_ns - self._picture_ns
        return replace(
            observed,
            base_present=observed.base_present and guarded,
            preview_running=age_ns <= _PICTURE_NS and self._picture.running,
            # A running camera has captured since; its age is judged by what the driver saw.
            newest_capture_ns=self._picture.newest_capture_ns + age_ns,
        )

    def _feed(self, event: Event, now_ns: int) -> None:
        before = self._state
        after = self._state = step(before, event, now_ns, self._rules)
        self._episode = followed(self._episode, before, after, now_ns)
        self._count(event, before, after)
        if after.output == ZERO != before.output:
            self._stress_until_ns = now_ns + _STRESS_NS
            # Not at the next cycle: a stop of the robot counts from here, whichever source moved it before.
            self._publish_now(now_ns)
        if _differs(before, after):
            self._beat(now_ns)
            self._report(now_ns)
            _log_change(before, after)

    def _publish(self, now_ns: int) -> None:
        """Publishes what the state says, as often as it is needed."""
        if self._state.output is None:
            return
        rare = self._state.output == ZERO and now_ns >= self._stress_until_ns
        if not rare or now_ns - self._published_ns >= _ZERO_EVERY_NS:
            self._publish_now(now_ns)

    def _publish_now(self, now_ns: int) -> None:
        present_ns, expires_ns = time.monotonic_ns(), self._state.expires_ns
        if present_ns - now_ns > _STALE_NS or (expires_ns is not None and present_ns >= expires_ns):
            now_ns = present_ns
            self._feed(Tick(), now_ns)
        if self._state.output is not None:
            self._base.publish(self._state.output, now_ns)
            self._published_ns = now_ns
            self._counters.published += 1

    def _publish_lock(self, now_ns: int) -> None:
        """Repeats the lock while it is to be active, and its release a few times."""
        if self._state.locked(now_ns):
            self._unlocks = _FAREWELL_ZEROS
            self._base.lock(now_ns, active=True)
        elif self._unlocks and self._base.lock(now_ns, active=False):
            # One that is not decided yet is requested in each cycle.
            self._unlocks -= 1

    def _beat(self, now_ns: int) -> None:
        try:
            beat = wire.heartbeat(self._state, self._episode, self._matched, lock_left=self.lock_left)
            self._heartbeats.send(beat.SerializeToString(), socket.MSG_DONTWAIT)
        except BlockingIOError:
            self._judge_guard(now_ns)
        except OSError:
            self._lose_guard("the guard has gone")
        else:
            self._guard_read_ns = now_ns

    def _judge_guard(self, now_ns: int) -> None:
        """Gives a guard up that has read no heartbeat for too long; without a driver it may be frozen."""
        frozen = now_ns - self._guard_read_ns > _GUARD_NS
        if frozen and self._state.phase not in RESTING:
            self._lose_guard("the guard is frozen")

    def _lose_guard(self, reason: str) -> None:
        # Without a guard nothing would stop the robot if this process froze.
        _log.error("%s", reason)
        self.stopping = self.orphaned = True

    def _report(self, now_ns: int) -> None:
        self._reported_ns = now_ns
        self._endpoint.send(pb.FromDrive(actual=self._actual(now_ns)))

    def _actual(self, now_ns: int) -> pb.ActualState:
        return wire.actual_state(
            self._state,
            self._rules,
            now_ns,
            revision=self._revision,
            counters=self._counters,
            episode=self._episode,
            problems=self._problems(),
        )

    def _problems(self) -> list[str]:
        problems = self._base.problems()
        # The first: a report has room for some text alone, and cuts what comes last.
        return [self._guard_problem, *problems] if self._guard_problem else problems

    def _count(self, event: Event, before: State, after: State) -> None:
        counters = self._counters
        counters.ignored += after.ignored - before.ignored
        counters.commands += after.command is not None and after.command is not before.command
        counters.stops += isinstance(event, Stop)
        counters.inhibited += before.phase is Phase.DRIVING and after.phase is Phase.INHIBITED

    def _say_farewell(self) -> None:
        """Publishes zeros, whatever the phase, unless others have the robot."""
        if self._state.output is None:
            return
        for _ in range(_FAREWELL_ZEROS):
            self._base.publish(ZERO, time.monotonic_ns())
        self._end_episode(time.monotonic_ns())
        self._base.wait_until_acknowledged()

    def _end_episode(self, now_ns: int) -> None:
        """Reports the end of the motion that this process has ended."""
        if self._episode is None or self._episode.ended_ns:
            return
        self._episode = self._episode.ended(now_ns, "robot-drive was ended")
        if not self.orphaned:
            self._beat(now_ns)
        self._report(now_ns)


def _differs(before: State, after: State) -> bool:
    """Whether a reader must learn of it at once."""
    return (before.phase, before.inhibits, before.latch, before.lease, before.enabled) != (
        after.phase,
        after.inhibits,
        after.latch,
        after.lease,
        after.enabled,
    )


def _log_change(before: State, after: State) -> None:
    if before.phase is not after.phase:
        reasons = ", ".join(sorted(inhibit.value for inhibit in after.inhibits))
        _log.info("%s -> %s%s", before.phase.value, after.phase.value, f" ({reasons})" if reasons else "")


def new_instance_id() -> str:
    """Returns what names this process."""
    return secrets.token_hex(8)
