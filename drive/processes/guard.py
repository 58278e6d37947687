"""The parent of the worker: when the worker is silent, it is killed, zeros go out, and a new one is started.

The guard has a publisher of its own, which publishes nothing but zeros. If both processes freeze, only the
base's own timeout stops the robot; `robot-drive doctor` says whether it has one.
"""

import logging
import os
import select
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Final, Protocol

from google.protobuf.message import DecodeError

from common import heartbeat
from common.backoff import Backoff
from common.errors import ExitCode
from drive.endpoint.wire import RESTING_PHASES, episode_of
from drive.motion.episode import Episode
from drive.motion.machine import OnLoss
from drive.motion.values import MS, ZERO, Latch, Velocity
from drive.processes.reach import ReachSaid
from drive.processes.real_time import delayed_by
from drive.processes.stop_file import StopFile, Stops
from drive.processes.watch import Watch
from omniseer.drive.v1 import drive_pb2 as pb

_log = logging.getLogger(__name__)

HEARTBEATS: Final = "DRIVE_HEARTBEATS"
"""Environment variable of the worker: descriptor that heartbeats are sent to."""
STOPS: Final = "DRIVE_STOPS"
"""Environment variable of the worker: the stops that it starts with (drive.processes.stop_file.Stops)."""
KILLS: Final = "DRIVE_KILLS"
"""Environment variable of the worker: how many before it were killed."""
_ZERO_EVERY_S: Final = 0.02
_HAND_BACK_NS: Final = 500 * MS
_END_NS: Final = 2_000 * MS
"""For the worker's end after SIGTERM, and for that of a killed one."""
_EXIT_NS: Final = 500 * MS
"""From a worker's last heartbeat to its exit; it publishes nothing in this time."""
_LONGEST_WAIT_S: Final = 1.0
"""The guard's own heartbeats go out as often."""
_MAX_BEAT_BYTES: Final = 16 * 1024
_SEND_BUFFER_BYTES: Final = 7 * 1024
"""SO_SNDBUF, which the kernel doubles: room for the largest heartbeat, and for 0.4 s of usual ones at most,
so that the worker soon notices a guard that reads none."""
_FIRST_PAUSE_S: Final = 0.1
_LONGEST_PAUSE_S: Final = 5.0
_REFUSALS: Final = frozenset({ExitCode.FAILED, ExitCode.USAGE})
"""Of a worker that says why it does not start: another attempt would say the same."""


class ZeroPort(Protocol):
    """What the guard needs of its publisher (drive.ros.base.VelocityPublisher)."""

    def publish(self, velocity: Velocity) -> None:
        """Publishes a velocity."""

    def matched(self) -> int:
        """Returns how many subscriptions take the zeros."""

    def wait_until_acknowledged(self) -> None:
        """Waits, for a moment, until the last velocity has arrived."""


class Guard:
    """Runs workers until it is stopped.

    Args:
        command: of the worker.
        velocities: the guard's own publisher.
        on_loss: whether the robot stays stopped when a worker is lost while a driver has it.
        stop_file: keeps the stop.
        stops: at the start.
    """

    def __init__(
        self,
        command: Sequence[str],
        velocities: ZeroPort,
        on_loss: OnLoss,
        stop_file: StopFile,
        stops: Stops,
    ) -> None:
        self._command = command
        self._velocities = velocities
        self._on_loss = on_loss
        self._stop_file = stop_file
        self._stops = stops
        self._episode: Episode | None = None
        """The newest, as the worker has reported it."""
        self._backoff = Backoff(_FIRST_PAUSE_S, _LONGEST_PAUSE_S)
        self._heartbeats = heartbeat.own()
        self._zeros_until_ns = 0
        self._kills = 0
        self._served = False
        self._end_by_ns: int | None = None
        self._worker: subprocess.Popen[bytes] | None = None
        self._wake, self._waker = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._waker.setblocking(False)

    def stop(self) -> None:
        """Ends the worker, and then `run`. May be called by a signal handler, any number of times."""
        if self._end_by_ns is None:
            self._end_by_ns = time.monotonic_ns() + _END_NS
            self._heartbeats.stopping()
        if self._worker:
            self._worker.terminate()
        with suppress(BlockingIOError):
            self._waker.send(b".")

    def run(self) -> int:
        """Runs workers until `stop`. Zeros are the last of all where a driver had the robot.

        Returns:
            The exit code: that of the first worker if it has refused to start, otherwise 0.

        Raises:
            OSError, MemoryError: the first worker can't be started.
        """
        while self._end_by_ns is None:
            try:
                worker, heartbeats = self._started_worker()
            except (OSError, MemoryError) as error:
                if not self._served:
                    raise
                # Short of memory, or of processes: what may have ended the last one as well.
                _log.error("no worker can be started; it is tried again: %s", str(error) or "out of memory")
            else:
                code = self._run_worker(worker, heartbeats)
                if not self._served and code in _REFUSALS:
                    return code
            if self._end_by_ns is None:
                self._publish_zeros_for(self._backoff.next_s())
        if self._zeros_until_ns:
            self._velocities.publish(ZERO)
            self._velocities.wait_until_acknowledged()
        return 0

    def _started_worker(self) -> "tuple[subprocess.Popen[bytes], socket.socket]":
        """Returns a new worker, and the end of its heartbeats that is this process's.

        Raises:
            OSError, MemoryError: it can't be started.
        """
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        environment = os.environ | {
            HEARTBEATS: str(theirs.fileno()),
            STOPS: self._stops.as_json(),
            KILLS: str(self._kills),
        }
        with theirs:
            try:
                # Without common.child.end_with_parent: when this process is killed, the worker has the last
                # word (zeros), and ends by itself because nothing reads its heartbeats.
                worker = self._worker = subprocess.Popen(  # noqa: S603  # this program's own worker
                    self._command, env=environment, pass_fds=[theirs.fileno()]
                )
            except (OSError, MemoryError):
                ours.close()
                raise
        if self._end_by_ns is not None:
            worker.terminate()  # The signal to stop came while it was being started.
        return worker, ours

    def _run_worker(self, worker: "subprocess.Popen[bytes]", heartbeats: socket.socket) -> int | None:
        """Follows a worker to its end, and takes its loss; returns its exit code, None while it has none.

        Args:
            worker: that has just been started.
            heartbeats: of it; closed here.
        """
        with heartbeats:
            watch = Watch.started(time.monotonic_ns())
            failure = self._follow(heartbeats, watch, worker.pid)
        if failure:
            if watch.leased:
                # A guard that can't publish ends here, and leaves the zeros to the worker, which may be late.
                self._velocities.publish(ZERO)
            # First the kill, then the zeros: a worker that thaws must not have the last word.
            worker.kill()
            self._kills += 1
        if watch.leased:
            self._take_loss()
        self._await_end(worker)
        level = logging.INFO if self._end_by_ns is not None and not failure else logging.ERROR
        _log.log(level, "%s (exit code %s)", failure or "the worker has ended", worker.returncode)
        return worker.returncode

    def _take_loss(self) -> None:
        """Sends zeros from now on, until the next worker takes over or the robot is handed back."""
        self._velocities.publish(ZERO)
        if self._episode:
            self._keep_episode(self._episode.ended(time.monotonic_ns(), "robot-drive lost its worker"))
        if self._end_by_ns is not None:
            self._zeros_until_ns = sys.maxsize  # It said farewell; one more does no harm.
        elif self._on_loss is OnLoss.HAND_BACK and self._stops.latch is None:
            self._zeros_until_ns = time.monotonic_ns() + _HAND_BACK_NS
        else:
            self._zeros_until_ns = sys.maxsize
            if self._stops.latch is None:
                stop_id = self._stops.last_id + 1
                reason = "its worker was lost while a driver had the robot"
                latch = Latch(stop_id, "robot-drive", reason)
                self._stops = replace(self._stops, last_id=stop_id, latch=latch)
                self._stop_file.keep(self._stops)

    def _follow(self, heartbeats: socket.socket, watch: Watch, pid: int) -> str:
        """Reads heartbeats until they end (empty) or the worker has to be killed; returns why, for people.

        Where a driver had the robot before, zeros go out until the worker has taken over.
        """
        reach = ReachSaid(heartbeats)
        while True:
            wait_s = max(0.0, (watch.deadline_ns - time.monotonic_ns()) / 1e9)
            wait_s = min(wait_s, self._publish_zero())
            self._heartbeats.send()
            if _is_readable(heartbeats, min(wait_s, _LONGEST_WAIT_S)):
                beat = _received(heartbeats)
                if not beat:
                    return ""
                try:
                    self._take_beat(beat, watch)
                except DecodeError:
                    return "the worker sends what is no heartbeat, and is killed"
                reach.say(self._velocities.matched())
            elif watch.silent(now_ns := time.monotonic_ns()):
                silent_ms = (now_ns - watch.heard_ns) // MS
                return f"no heartbeat of the worker for {silent_ms} ms, {delayed_by(pid)}: it is killed"
            if self._end_by_ns is not None and time.monotonic_ns() >= self._end_by_ns:
                return "the worker does not end, and is killed"

    def _take_beat(self, beat: bytes, watch: Watch) -> None:
        actual = pb.ActualState.FromString(beat)
        if not watch.began:
            if not self._served:
                self._heartbeats.ready()
            self._served = True
            self._backoff.reset()
        if self._zeros_until_ns:
            self._judge_takeover(actual, first=not watch.began)
        watch.beat(time.monotonic_ns(), leased=actual.phase not in RESTING_PHASES)
        stop = actual.stop
        latch = Latch(stop.stop_id, stop.by, stop.reason) if actual.HasField("stop") else None
        last_id = max(self._stops.last_id, stop.stop_id)
        self._stops = replace(self._stops, last_id=last_id, latch=latch, lock_left=actual.lock_left)
        self._keep_episode(episode_of(actual))

    def _judge_takeover(self, actual: pb.ActualState, *, first: bool) -> None:
        """Ends the zeros once the worker's velocities reach what they reach, or other velocities are due.

        To discover the multiplexer may take the worker longer than the multiplexer remembers an input;
        another source would move a stopped robot then. A subscription that died may count here for longer
        than for the worker, until the middleware drops it: beside the worker's own zeros these do no harm.
        """
        due = actual.phase == pb.PHASE_DRIVING or actual.phase in RESTING_PHASES
        if due or actual.matched >= self._velocities.matched():
            self._zeros_until_ns = 0
        elif first:
            _log.warning("the new worker's velocities do not arrive yet: the zeros of the guard go on")

    def _keep_episode(self, episode: Episode | None) -> None:
        """Keeps the stops, and the episode once it has ended, until a gateway has recorded it."""
        self._episode = episode
        self._stops = replace(self._stops, episode=episode if episode and episode.unrecorded else None)
        self._stop_file.keep(self._stops)

    def _await_end(self, worker: "subprocess.Popen[bytes]") -> None:
        """Waits for the end of a worker; one that a device driver holds in the kernel is given up."""
        began_ns = time.monotonic_ns()
        while (elapsed_ns := time.monotonic_ns() - began_ns) < _END_NS:
            if elapsed_ns >= _EXIT_NS:
                worker.kill()
            try:
                worker.wait(min(self._publish_zero(), _EXIT_NS / 1e9))
            except subprocess.TimeoutExpired:
                continue
            return

    def _publish_zeros_for(self, duration_s: float) -> None:
        """Waits before the next attempt, with zeros where they are due."""
        end_ns = time.monotonic_ns() + int(duration_s * 1e9)
        while self._end_by_ns is None and time.monotonic_ns() < end_ns:
            wait_s = self._publish_zero()
            self._heartbeats.send()
            _is_readable(self._wake, min(wait_s, (end_ns - time.monotonic_ns()) / 1e9))

    def _publish_zero(self) -> float:
        """Publishes a zero if one is due; returns in how many seconds to come again."""
        if time.monotonic_ns() >= self._zeros_until_ns:
            return _LONGEST_WAIT_S
        self._velocities.publish(ZERO)
        return _ZERO_EVERY_S


def _is_readable(waited_for: socket.socket, timeout_s: float) -> bool:
    ready, _, _ = select.select([waited_for], [], [], max(0.0, timeout_s))
    return bool(ready)


def _received(heartbeats: socket.socket) -> bytes:
    """Returns the next heartbeat, which has arrived; empty at their end."""
    with suppress(ConnectionResetError):  # Once, of a worker that has ended before it has read all.
        return heartbeats.recv(_MAX_BEAT_BYTES)
    return heartbeats.recv(_MAX_BEAT_BYTES)


def worker_heartbeats() -> socket.socket:
    """Returns the worker's end of the heartbeats, in the worker."""
    heartbeats = socket.socket(fileno=int(os.environ.pop(HEARTBEATS)))
    heartbeats.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
    return heartbeats


def worker_kills() -> int:
    """Returns how many workers before this one were killed, in the worker."""
    return int(os.environ.pop(KILLS))


def worker_stops() -> Stops:
    """Returns the stops that the worker starts with, in the worker."""
    return Stops.from_json(os.environ.pop(STOPS))
