"""The guard, with small programs for workers: what it publishes, when it kills, what it keeps."""

import errno
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import psutil
import pytest

from drive.motion.machine import OnLoss
from drive.motion.values import MS, ZERO, Latch, Velocity
from drive.processes.guard import Guard
from drive.processes.stop_file import StopFile, Stops, read_stops
from tests.support.undisturbed import END, SILENT
from tests.support.waiting import wait_until

ROOT = Path(__file__).parents[4]
BEATS = """
import os, signal, socket, sys, time
from omniseer.drive.v1 import drive_pb2 as pb
started, then = sys.argv[1], sys.argv[2]
later = os.path.exists(started)
def begin():
    with open(started, "a") as file:
        file.write(str(os.getpid()) + "\\n")
if then == "crash" and later:
    begin()
    sys.exit(3)
beats = socket.socket(fileno=int(os.environ["DRIVE_HEARTBEATS"]))
if then == "ignore":
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
episode = pb.Episode(episode_id=3, holder="anna", started_ns=1, distance_m=0.5)
phase = pb.PHASE_AVAILABLE if then in ("rest", "lock") else pb.PHASE_DRIVING
if later and then.startswith("PHASE_"):
    phase = pb.Phase.Value(then)
with open(started + ".stops", "w") as file:
    file.write(os.environ["DRIVE_STOPS"])
for number in range(1_000_000):
    if number == 20 or then == "garbage":
        begin()
    matched = int(os.path.exists(started + ".matched"))
    state = pb.ActualState(phase=phase, episode=episode, matched=matched, lock_left=then == "lock")
    beats.send(b"\\xff\\xff" if then == "garbage" else state.SerializeToString())
    if then == "freeze" and number == 30:
        os.kill(os.getpid(), signal.SIGSTOP)
    if then == "listen":
        try:
            word = beats.recv(1, socket.MSG_DONTWAIT)
        except BlockingIOError:
            word = b""
        with open(started + ".heard", "ab") as file:
            file.write(word)
    time.sleep(0.01)
"""


@dataclass
class Zeros:
    """The guard's publisher, and how many subscriptions take its zeros."""

    at_s: list[float] = field(default_factory=list)
    takers: int = 1

    def publish(self, velocity: Velocity) -> None:
        assert velocity == ZERO
        self.at_s.append(time.monotonic())

    def matched(self) -> int:
        return self.takers

    def wait_until_acknowledged(self) -> None:
        pass

    def since(self, began_s: float) -> list[float]:
        return [at_s - began_s for at_s in self.at_s if at_s >= began_s]


@dataclass
class Running:
    guard: Guard
    zeros: Zeros
    started: Path
    stop_file: Path

    def pids(self) -> list[int]:
        return [int(line) for line in self.started.read_text().split()] if self.started.exists() else []

    def worker(self, count: int = 1) -> int:
        """The process ID of the newest of so many workers, once it has sent heartbeats for a while."""
        wait_until(lambda: len(self.pids()) >= count, f"{count} workers")
        return self.pids()[-1]


@contextmanager
def guarding(
    tmp_path: Path,
    then: str,
    on_loss: OnLoss = OnLoss.HOLD,
    stops: Stops | None = None,
    zeros: Zeros | None = None,
) -> Iterator[Running]:
    path = tmp_path / "stop.json"
    stop_file, zeros = StopFile(path), zeros or Zeros()
    started = tmp_path / "started"
    command = [sys.executable, "-c", BEATS, str(started), then]
    guard = Guard(command, zeros, on_loss, stop_file, stops or Stops())
    thread = threading.Thread(target=guard.run)
    thread.start()
    try:
        yield Running(guard, zeros, started, path)
    finally:
        guard.stop()
        thread.join(10)
        assert not thread.is_alive()
        stop_file.close()


@pytest.fixture(autouse=True)
def _importable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", f"{ROOT}:{ROOT / 'proto/python'}")


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_lost_worker_means_zeros_until_the_next_one_has_the_robot(
    tmp_path: Path, number: signal.Signals
) -> None:
    with guarding(tmp_path, "beat") as running:
        lost = running.worker()
        began_s = time.monotonic()
        os.kill(lost, number)
        wait_until(lambda: running.zeros.since(began_s), "zeros")
        wait_until(lambda: len(running.pids()) > 1, "the next worker")
        zeros = running.zeros.since(began_s)
        assert zeros[0] < 1.0
        assert max(b - a for a, b in pairwise(zeros)) < 0.5
    latch = read_stops(running.stop_file).latch
    assert latch is None or latch.by == "robot-drive"


def test_zeros_go_on_until_the_next_workers_velocities_arrive(tmp_path: Path) -> None:
    with guarding(tmp_path, "PHASE_STOPPED") as running:
        os.kill(running.worker(), signal.SIGKILL)
        running.worker(2)
        zeros = running.zeros.at_s
        before = len(zeros)
        wait_until(lambda: len(zeros) > before + 100, "zeros beside the next worker's heartbeats")
        (tmp_path / "started.matched").touch()
        wait_until(lambda: time.monotonic() - zeros[-1] > 0.5, "the end of the zeros")


@pytest.mark.parametrize(
    ("phase", "takers"),
    [
        pytest.param("PHASE_DRIVING", 1, id="it drives"),
        pytest.param("PHASE_AVAILABLE", 1, id="others have the robot"),
        pytest.param("PHASE_STOPPED", 0, id="nothing takes zeros"),
    ],
)
def test_zeros_end_where_none_are_due_or_none_arrive(tmp_path: Path, phase: str, takers: int) -> None:
    with guarding(tmp_path, phase) as running:
        running.zeros.takers = takers
        os.kill(running.worker(), signal.SIGKILL)
        running.worker(2)
        zeros = running.zeros.at_s
        wait_until(lambda: zeros and time.monotonic() - zeros[-1] > 0.5, "the end of the zeros")


def test_a_silent_worker_is_killed_and_the_log_says_what_it_waited_for(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with guarding(tmp_path, "beat") as running:
        os.kill(running.worker(), signal.SIGSTOP)
        wait_until(lambda: "it is stopped" in caplog.text, "the reason")
    (said,) = [line for line in caplog.text.splitlines() if END in line]
    assert SILENT in said, "as tests.support.undisturbed knows it"


def test_zeros_go_on_while_the_next_workers_fail(tmp_path: Path) -> None:
    with guarding(tmp_path, "crash") as running:
        lost = running.worker()
        began_s = time.monotonic()
        os.kill(lost, signal.SIGKILL)
        wait_until(lambda: len(running.pids()) >= 4, "three attempts")
        zeros = running.zeros.since(began_s)
        assert zeros[-1] > 0.6, "beyond the first attempt"
        episode = read_stops(running.stop_file).episode
        assert episode
        assert (episode.holder, episode.distance_m) == ("anna", 0.5)
        assert episode.ended_by == "robot-drive lost its worker"
        assert read_stops(running.stop_file).latch == Latch(
            1, "robot-drive", "its worker was lost while a driver had the robot"
        )


@pytest.mark.parametrize(
    "error", [BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN)), MemoryError()], ids=["fork", "memory"]
)
def test_zeros_go_on_while_no_worker_can_be_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, error: Exception
) -> None:
    """Where memory or processes are short: what the kernel has killed a worker for may keep out the next."""
    attempts: list[float] = []
    popen = subprocess.Popen

    def refused_twice(*command: Any, **options: Any) -> Any:
        attempts.append(time.monotonic())
        if len(attempts) <= 2:
            raise error
        return popen(*command, **options)

    with guarding(tmp_path, "PHASE_STOPPED") as running:
        running.worker()
        monkeypatch.setattr("drive.processes.guard.subprocess.Popen", refused_twice)

        def refused() -> bool:
            if not attempts:
                with suppress(ProcessLookupError):  # After a stall the guard has replaced it already.
                    os.kill(running.pids()[-1], signal.SIGKILL)
            return len(attempts) >= 3

        wait_until(refused, "the third attempt")
        assert "no worker can be started; it is tried again: " in caplog.text
        assert [at_s for at_s in running.zeros.at_s if attempts[0] < at_s < attempts[1]]
        assert [at_s for at_s in running.zeros.at_s if attempts[1] < at_s < attempts[2]]


def test_a_worker_that_can_never_be_started_ends_the_guard(tmp_path: Path) -> None:
    stop_file = StopFile(tmp_path / "stop.json")
    with pytest.raises(FileNotFoundError):
        Guard([str(tmp_path / "none")], Zeros(), OnLoss.HOLD, stop_file, Stops()).run()
    stop_file.close()


def test_a_guard_that_cant_publish_kills_no_worker_that_could(tmp_path: Path) -> None:
    """The worker's own zeros are the last then: it finds that the guard has gone."""

    class Broken(Zeros):
        def publish(self, velocity: Velocity) -> None:
            assert velocity == ZERO
            raise RuntimeError("publisher's context is invalid")

    started, stop_file = tmp_path / "started", StopFile(tmp_path / "stop.json")
    command = [sys.executable, "-c", BEATS, str(started), "freeze"]
    with pytest.raises(RuntimeError, match="context is invalid"):
        Guard(command, Broken(), OnLoss.HOLD, stop_file, Stops()).run()
    worker = psutil.Process(int(started.read_text()))
    try:
        assert worker.status() == psutil.STATUS_STOPPED
    finally:
        worker.kill()
    stop_file.close()


class Clock:
    """The guard's, which stands still but where the test moves it: how busy the machine is has no effect."""

    def __init__(self) -> None:
        self.now_ns = 10**12
        self._read = threading.local()

    def monotonic_ns(self) -> int:
        """The present instant."""
        self._read.newest_ns = self.now_ns
        return self.now_ns

    @property
    def newest_ns(self) -> int:
        """The instant that this thread has read last: what it does now it does as of that."""
        newest_ns: int = self._read.newest_ns
        return newest_ns


@dataclass
class DatedZeros(Zeros):
    """The guard's publisher; dates each zero by what the guard has read of its clock."""

    clock: Clock = field(default_factory=Clock)
    dated_ns: list[int] = field(default_factory=list)

    def publish(self, velocity: Velocity) -> None:
        super().publish(velocity)
        self.dated_ns.append(self.clock.newest_ns)


def test_hand_back_ends_the_zeros(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    zeros = DatedZeros()
    clock, dated_ns = zeros.clock, zeros.dated_ns
    monkeypatch.setattr("drive.processes.guard.time", clock)
    with guarding(tmp_path, "crash", OnLoss.HAND_BACK, zeros=zeros) as running:
        os.kill(running.worker(), signal.SIGKILL)
        lost_ns = clock.now_ns
        # The first goes out before the guard reads when the half second begins.
        wait_until(lambda: len(dated_ns) > 1, "two zeros")
        last_ns = clock.now_ns = lost_ns + 500 * MS - 1
        wait_until(lambda: dated_ns.count(last_ns) > 3, "zeros to the end of the half second")

        def four_attempts() -> bool:
            clock.now_ns += 10 * MS
            return len(running.pids()) >= 5

        wait_until(four_attempts, "four attempts", 20)
        assert dated_ns[-1] == last_ns
    assert read_stops(running.stop_file).latch is None


def test_a_worker_without_a_driver_is_replaced_silently(tmp_path: Path) -> None:
    with guarding(tmp_path, "rest") as running:
        os.kill(running.worker(), signal.SIGKILL)
        running.worker(2)
        assert not running.zeros.at_s


def test_what_is_no_heartbeat_ends_the_worker_and_not_the_guard(tmp_path: Path) -> None:
    with guarding(tmp_path, "garbage") as running:
        wait_until(lambda: len(running.pids()) >= 3, "three attempts", 20)


def test_a_worker_that_ignores_its_end_is_killed(tmp_path: Path) -> None:
    with guarding(tmp_path, "ignore") as running:
        running.worker()
        began_s = time.monotonic()
        for _ in range(100):
            running.guard.stop()
    assert time.monotonic() - began_s < 6
    assert running.zeros.since(began_s), "the last is zero"


def test_a_worker_that_refuses_to_start_ends_the_guard(tmp_path: Path) -> None:
    stop_file = StopFile(tmp_path / "stop.json")
    command = [sys.executable, "-c", "raise SystemExit(2)"]
    assert Guard(command, Zeros(), OnLoss.HOLD, stop_file, Stops()).run() == 2
    stop_file.close()


def test_the_number_of_the_last_stop_is_kept(tmp_path: Path) -> None:
    with guarding(tmp_path, "crash", stops=Stops(7)) as running:
        os.kill(running.worker(), signal.SIGKILL)
        wait_until(running.stop_file.exists, "the stop is kept")
        wait_until(lambda: read_stops(running.stop_file).last_id == 8, "with the next number")


def test_the_worker_learns_how_many_take_the_guards_zeros(tmp_path: Path) -> None:
    with guarding(tmp_path, "listen") as running:
        running.worker()
        heard = tmp_path / "started.heard"
        wait_until(lambda: heard.exists() and heard.read_bytes() == b"1", "it reaches the base")
        running.zeros.takers = 0
        wait_until(lambda: heard.read_bytes() == b"10", "it does not any more")


def test_a_lock_that_a_worker_has_left_is_handed_on(tmp_path: Path) -> None:
    with guarding(tmp_path, "lock") as running:
        os.kill(running.worker(), signal.SIGKILL)
        running.worker(2)
        assert Stops.from_json((tmp_path / "started.stops").read_bytes()).lock_left
    assert read_stops(running.stop_file).lock_left
    with guarding(tmp_path, "rest", stops=Stops(lock_left=True)) as running:
        running.worker(3)
        wait_until(lambda: not read_stops(running.stop_file).lock_left, "a worker that knows of its release")
