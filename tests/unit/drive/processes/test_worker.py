"""The worker's loop on a clock of its own: what is published when, and in which order."""

import socket
from collections import deque
from dataclasses import replace
from itertools import chain, repeat
from types import SimpleNamespace
from typing import Any

import pytest

from drive.endpoint.endpoint import Peer, Received
from drive.motion.machine import Rules, State
from drive.motion.phases import Phase
from drive.motion.values import MS, ZERO, Latch, Surroundings, Velocity
from drive.processes import worker as worker_module
from drive.processes.worker import Worker
from omniseer.drive.v1 import drive_pb2 as pb

START_NS = 10**12
CLEAR = Surroundings(base_present=True, still=True)


class World:
    """Clock, base, gateway and guard of a worker, with one journal of what it does."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, state: State | None = None) -> None:
        self.now_ns = START_NS
        self.journal: list[tuple[str, Any, int]] = []
        self.script: deque[tuple[int, Received | Exception]] = deque()
        self.surroundings = CLEAR
        self.observing_takes_ns = 0
        self.release_waits_until_ns = 0
        self.guard_gone = False
        self.guard_says = deque([b"1"])
        self.sequence = 0
        monkeypatch.setattr(worker_module, "time", SimpleNamespace(monotonic_ns=lambda: self.now_ns))
        monkeypatch.setattr(worker_module, "gc", SimpleNamespace(collect=int, disable=int))
        monkeypatch.setattr(worker_module, "freeze_objects", lambda: None)
        start = state or State.at_start(START_NS, enabled=True)
        port: Any = self
        self.worker = Worker(port, port, port, Rules(), start)

    # The endpoint.
    def wait(self, timeout_s: float) -> list[Received]:
        until_ns = self.now_ns + max(0, int(timeout_s * 1e9))
        if self.script and self.script[0][0] <= until_ns:
            self.now_ns, received = max(self.now_ns, self.script[0][0]), self.script.popleft()[1]
            if isinstance(received, Exception):
                raise received
            return [received]
        self.now_ns = until_ns
        if not self.script:
            self.worker.stopping = True
        return []

    # The base, and the guard's socket: both are sent to.
    def send(self, message: Any, *_flags: int) -> None:
        if isinstance(message, bytes):
            if self.guard_gone:
                raise BrokenPipeError
            self.journal.append(("beat", pb.ActualState.FromString(message), self.now_ns))

    def recv(self, *_: int) -> bytes:
        if self.guard_says:
            return self.guard_says.popleft()
        raise BlockingIOError

    def publish(self, velocity: Velocity, _now_ns: int) -> None:
        self.journal.append(("velocity", velocity, self.now_ns))

    def lock(self, _now_ns: int, *, active: bool) -> bool:
        self.journal.append(("lock", active, self.now_ns))
        return active or self.now_ns >= self.release_waits_until_ns

    def lock_left(self) -> bool:
        return any(kind == "lock" for kind, _, _ in self.journal)

    def observed(self, _now_ns: int) -> Surroundings:
        self.now_ns += self.observing_takes_ns
        return self.surroundings

    def matched(self) -> int:
        return 1

    def problems(self) -> list[str]:
        return []

    def wait_until_acknowledged(self) -> None:
        self.journal.append(("acknowledged", None, self.now_ns))

    # The script.
    def at(self, ms: float, received: Received | Exception) -> None:
        self.script.append((START_NS + int(ms * MS), received))

    def grant(self, ms: float) -> None:
        lease = pb.GrantLease(session_id="s1", holder="anna", line_of_sight=True, streaming=True)
        self.at(ms, pb.ToDrive(grant=lease))

    def command(self, ms: float, *, held: bool) -> None:
        self.sequence += 1
        now_ns = START_NS + int(ms * MS)
        command = pb.Command(
            session_id="s1",
            sequence=self.sequence,
            held=held,
            vx_mps=0.1 if held else 0.0,
            valid_until_ns=now_ns + 250 * MS,
            echo_ns=now_ns,
        )
        self.at(ms, pb.ToDrive(command=command))

    def drives(self) -> None:
        """The driver holds from 40 ms on, with a command every 20 ms, the last of them at 200 ms."""
        self.at(0, Peer.JOINED)
        self.grant(5)
        self.command(20, held=False)
        for ms in range(40, 201, 20):
            self.command(ms, held=True)

    def end(self, ms: float) -> None:
        """Nothing more happens from then on."""
        self.at(ms, pb.ToDrive(picture=pb.Picture()))

    def timed_beats(self) -> list[tuple[pb.ActualState, int]]:
        return [(what, ns) for kind, what, ns in self.journal if kind == "beat"]

    def beats(self) -> list[pb.ActualState]:
        return [beat for beat, _ in self.timed_beats()]

    def velocities(self) -> list[tuple[float, Velocity]]:
        return [((ns - START_NS) / MS, what) for kind, what, ns in self.journal if kind == "velocity"]

    def moving(self) -> list[float]:
        return [ms for ms, velocity in self.velocities() if velocity != ZERO]


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> World:
    return World(monkeypatch)


def test_motion_ends_with_the_validity_of_the_last_command_and_not_a_cycle_later(world: World) -> None:
    world.drives()
    world.end(600)
    world.worker.run()
    last = world.moving()[-1]
    zero = next(ms for ms, velocity in world.velocities() if ms > last and velocity == ZERO)
    assert 430 <= last <= 450
    assert zero == pytest.approx(450, abs=1)


def test_a_stop_without_a_driver_is_published_at_once(world: World) -> None:
    world.at(5, Peer.JOINED)
    world.at(33, pb.ToDrive(stop=pb.Stop(by="ben")))
    world.end(60)
    world.worker.run()
    assert world.velocities()[0] == (33, ZERO)
    assert [ms for ms, _ in world.velocities()][1] <= 83, "and again, without a rest"
    beats = [(what.stop.by, (ns - START_NS) / MS) for kind, what, ns in world.journal if kind == "beat"]
    assert ("ben", 33) in beats, "the guard knows of it at once: the next worker starts with it"


def test_the_guard_knows_of_the_lease_before_anything_moves(world: World) -> None:
    world.drives()
    world.end(210)
    world.worker.run()
    for index, (kind, what, _) in enumerate(world.journal):
        if kind == "velocity" and what != ZERO:
            newest = next(beat for kind, beat, _ in reversed(world.journal[:index]) if kind == "beat")
            assert newest.phase == pb.PHASE_DRIVING


def test_a_gateway_that_goes_takes_the_lease_with_it(world: World) -> None:
    world.at(5, Peer.JOINED)
    world.grant(6)
    world.at(6, Peer.LEFT)
    world.end(1000)
    world.worker.run()
    assert not world.moving()
    beats = [what for kind, what, _ in world.journal if kind == "beat"]
    assert beats[-1].phase == pb.PHASE_AVAILABLE
    assert beats[-1].session_id == ""


def test_a_suspend_loses_the_driver_before_what_has_arrived_counts(world: World) -> None:
    world.drives()
    once = chain([True], repeat(False))
    world.worker._suspends = SimpleNamespace(  # type: ignore[assignment]
        resumed=lambda: world.now_ns >= START_NS + 150 * MS and next(once)
    )
    world.end(400)
    world.worker.run()
    assert world.moving()
    assert max(world.moving()) < 150
    assert world.worker.state.latch
    assert "the driver was lost" in world.worker.state.latch.reason


def test_the_last_is_zero_when_the_loop_fails(world: World) -> None:
    world.drives()
    world.at(210, RuntimeError("a defect"))
    with pytest.raises(RuntimeError, match="a defect"):
        world.worker.run()
    assert world.moving()
    assert world.velocities()[-1][1] == ZERO
    assert world.journal[-1][0] == "acknowledged"


def test_a_motion_that_the_end_of_the_program_ends_is_reported_to_the_guard(world: World) -> None:
    world.drives()
    world.end(210)
    world.worker.run()
    episode = world.beats()[-1].episode
    assert (episode.holder, episode.ended_by) == ("anna", "robot-drive was ended")
    assert 0 < episode.started_ns < episode.ended_ns
    assert not episode.recorded
    assert world.worker.unrecorded


def test_a_motion_stays_until_a_gateway_has_recorded_it(world: World) -> None:
    world.drives()
    world.command(220, held=False)
    for ms, number in ((300, 2), (400, 1)):
        started_ns = START_NS + 40 * MS
        world.at(ms, pb.ToDrive(recorded=pb.Recorded(episode_id=number, started_ns=started_ns)))
    world.end(600)
    world.worker.run()
    between_ns = START_NS + 400 * MS
    assert not any(beat.episode.recorded for beat, at_ns in world.timed_beats() if at_ns < between_ns)
    assert world.beats()[-1].episode.recorded
    assert world.worker.unrecorded is None


def test_the_last_is_zero_without_a_guard(world: World) -> None:
    world.drives()

    def gone(message: Any, *flags: int) -> None:
        world.guard_gone = world.guard_gone or world.now_ns >= START_NS + 150 * MS
        World.send(world, message, *flags)

    setattr(world, "send", gone)  # noqa: B010  # the worker holds the world itself
    world.end(5000)
    world.worker.run()
    assert world.moving()
    assert world.velocities()[-1][1] == ZERO
    assert world.velocities()[-1][0] <= 171


def test_a_decision_that_grew_old_before_it_was_published_is_made_again(world: World) -> None:
    """As when the process, and its guard, are frozen in the middle of a cycle."""
    world.drives()
    world.end(199)
    world.script = deque(sorted(world.script, key=lambda entry: entry[0]))
    world.observing_takes_ns = 0
    held = [ns for ns, _ in world.script]
    assert held
    observed = world.observed

    def frozen_once(now_ns: int) -> Surroundings:
        if now_ns >= START_NS + 190 * MS:
            world.now_ns += 300 * MS
        return observed(now_ns)

    setattr(world, "observed", frozen_once)  # noqa: B010
    world.worker.run()
    assert world.moving()
    assert world.moving()[-1] <= 190
    assert "no valid command" in world.beats()[-1].episode.ended_by, "and its motion has ended then"


def test_a_command_that_expires_between_decision_and_publisher_moves_nothing(world: World) -> None:
    """The graph takes a while to be observed; the decision is of the cycle's beginning."""
    world.drives()
    world.end(600)
    observed = world.observed

    def slow_at_the_end(now_ns: int) -> Surroundings:
        if START_NS + 430 * MS <= now_ns < START_NS + 450 * MS:
            world.now_ns += 22 * MS
        return observed(now_ns)

    setattr(world, "observed", slow_at_the_end)  # noqa: B010
    world.worker.run()
    assert 400 <= world.moving()[-1] <= 450
    assert "no valid command" in world.beats()[-1].episode.ended_by


def test_zeros_are_stressed_at_first(world: World) -> None:
    world.at(5, Peer.JOINED)
    world.at(10, pb.ToDrive(stop=pb.Stop(by="ben")))
    world.end(1500)
    world.worker.run()
    at_ms = [ms for ms, velocity in world.velocities() if velocity == ZERO]
    assert sum(ms < 500 for ms in at_ms) >= 24, "50 a second"
    assert 15 <= sum(600 <= ms < 1500 for ms in at_ms) <= 19, "20 a second"


def test_zeros_precede_the_lock_and_the_lock_is_taken_back(world: World) -> None:
    world.at(5, Peer.JOINED)
    world.at(10, pb.ToDrive(stop=pb.Stop(by="ben")))
    world.at(500, pb.ToDrive(reset=pb.Reset(stop_id=1)))
    world.end(1500)
    world.worker.run()
    locks = [((ns - START_NS) / MS, active) for kind, active, ns in world.journal if kind == "lock"]
    assert 310 <= locks[0][0] <= 350
    assert {active for ms, active in locks if ms < 500} == {True}
    assert [active for ms, active in locks if ms >= 500][-5:] == [False] * 5


def test_a_release_of_the_lock_that_has_to_wait_is_requested_until_it_is_decided(world: World) -> None:
    world.release_waits_until_ns = START_NS + 3000 * MS
    world.at(5, Peer.JOINED)
    world.at(10, pb.ToDrive(stop=pb.Stop(by="ben")))
    world.at(500, pb.ToDrive(reset=pb.Reset(stop_id=1)))
    world.end(5000)
    world.worker.run()
    decided = [ns for kind, _, ns in world.journal if kind == "lock" and ns >= world.release_waits_until_ns]
    assert len(decided) == 5


def test_the_guard_knows_of_a_lock_that_is_left(world: World) -> None:
    world.at(5, Peer.JOINED)
    world.at(10, pb.ToDrive(stop=pb.Stop(by="ben")))
    world.end(1000)
    world.worker.run()
    assert not world.beats()[0].lock_left
    assert world.beats()[-1].lock_left


def test_nothing_is_said_where_others_have_the_robot(world: World) -> None:
    world.end(1000)
    world.worker.run()
    assert world.velocities() == []


def test_a_latched_worker_starts_with_zeros(monkeypatch: pytest.MonkeyPatch) -> None:
    state = State.at_start(START_NS, enabled=False, latch=Latch(3, "ben", ""))
    world = World(monkeypatch, state)
    world.end(290)
    world.worker.run()
    assert world.velocities()
    assert {velocity for _, velocity in world.velocities()} == {ZERO}
    assert not [kind for kind, _, _ in world.journal if kind == "lock"]


def test_a_picture_between_two_words_of_the_gateway_is_possible(world: World) -> None:
    """The gateway reports the newest capture now and then; a running camera has captured since."""
    picture = pb.Picture(running=True, newest_capture_ns=START_NS - 30 * MS)
    world.at(0, pb.ToDrive(picture=picture))
    lease = pb.GrantLease(session_id="s1", holder="anna", streaming=True)
    world.at(1, pb.ToDrive(grant=lease))
    for sequence, ms in enumerate(range(20, 801, 20), start=1):
        now_ns = START_NS + ms * MS
        command = pb.Command(
            session_id="s1",
            sequence=sequence,
            held=sequence > 1,
            vx_mps=0.1,
            valid_until_ns=now_ns + 250 * MS,
            echo_ns=now_ns,
            picture_ns=now_ns - 100 * MS,
        )
        world.at(ms, pb.ToDrive(command=command))
    world.worker.run()
    phases = {what.phase for kind, what, ns in world.journal if kind == "beat" and ns > START_NS + 60 * MS}
    assert phases == {pb.PHASE_DRIVING}
    assert Phase.DRIVING


def test_a_guard_that_reads_nothing_is_given_up_while_a_driver_has_the_robot(world: World) -> None:
    world.drives()
    for ms in range(220, 3001, 20):
        world.command(ms, held=True)

    def frozen(message: Any, *flags: int) -> None:
        if isinstance(message, bytes) and world.now_ns >= START_NS + 500 * MS:
            raise BlockingIOError
        World.send(world, message, *flags)

    setattr(world, "send", frozen)  # noqa: B010
    world.worker.run()
    assert 1180 <= world.moving()[-1] <= 1220
    assert world.velocities()[-1][1] == ZERO
    assert world.worker.orphaned


def test_without_a_driver_a_frozen_guard_ends_nothing(world: World) -> None:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        ours.setblocking(False)
        setattr(world, "send", lambda message, *_: ours.send(message) if isinstance(message, bytes) else None)  # noqa: B010
        for ms in range(0, 100_000, 100):
            world.end(ms)
        world.worker.run()


def test_the_guard_knows_how_many_take_the_velocities(world: World) -> None:
    world.surroundings = Surroundings(base_present=False)
    world.end(210)
    world.worker.run()
    assert {beat.matched for beat in world.beats()} == {1}


def test_nothing_moves_before_the_guard_reaches_the_base(world: World) -> None:
    world.guard_says.clear()
    world.drives()
    world.end(210)
    world.worker.run()
    assert not world.moving()
    report = world.worker._actual(world.now_ns)
    assert list(report.inhibits) == [pb.INHIBIT_BASE_ABSENT]
    assert list(report.problems) == [
        "the guard of robot-drive does not reach the base yet, and could not stop it"
    ]


def test_no_other_problem_keeps_the_guards_out_of_a_report(world: World) -> None:
    """The defect: it came last, and what the names of a graph make longer than a report cut it off."""
    world.guard_says.clear()
    setattr(world, "problems", lambda: ["x" * 4096])  # noqa: B010
    world.end(210)
    world.worker.run()
    problems = world.worker._actual(world.now_ns).problems
    assert problems[0] == "the guard of robot-drive does not reach the base yet, and could not stop it"


def test_a_report_without_a_driver_has_the_robots_own_reasons(world: World) -> None:
    world.surroundings = replace(world.surroundings, robot_stopped=True)
    world.end(210)
    world.worker.run()
    report = world.worker._actual(world.now_ns)
    assert (report.phase, list(report.inhibits)) == (pb.PHASE_AVAILABLE, [pb.INHIBIT_ROBOT_STOP])


def test_a_guard_that_reaches_the_base_no_more_ends_the_motion(world: World) -> None:
    world.drives()
    observed = world.observed

    def loses_it(now_ns: int) -> Surroundings:
        if now_ns >= START_NS + 150 * MS:
            world.guard_says.append(b"0")
        return observed(now_ns)

    setattr(world, "observed", loses_it)  # noqa: B010
    world.end(210)
    world.worker.run()
    assert world.moving()
    assert max(world.moving()) < 150
